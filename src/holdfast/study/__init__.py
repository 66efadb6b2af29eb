"""The study: every table and figure of the paper, and the ones that it should have had."""
