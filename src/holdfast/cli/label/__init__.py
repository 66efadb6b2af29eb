"""The verb `holdfast label`; one file for each of its modes."""
