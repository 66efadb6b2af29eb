"""Tables, the report and the folder of a study."""
