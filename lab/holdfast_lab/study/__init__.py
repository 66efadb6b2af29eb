"""The study: the tables and figures of the paper, and evaluations that the paper lacks."""
