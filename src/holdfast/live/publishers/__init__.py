"""Publishers of samples: the protocol of XELA."""
