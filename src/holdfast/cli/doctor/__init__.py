"""The verb `holdfast doctor`, and what it says of the installation."""
