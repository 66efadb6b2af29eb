"""Tables, the HTML report and the folder of a study."""
