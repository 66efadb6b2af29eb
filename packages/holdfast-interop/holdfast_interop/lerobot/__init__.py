"""LeRobot data sets (v3.0): their layout, the export, and the import of what was exported."""
