"""MCAP files for Foxglove: plots, states, a log, arrows of the taxels, and a layout of panels."""
