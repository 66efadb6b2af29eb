"""What every page of holdfast stands on: who may come in, and serving until Ctrl-C."""
