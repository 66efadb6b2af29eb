"""The tables and figures of the paper, by the protocol of the paper."""
