"""The verb `holdfast simulate`, and the options of its grasps."""
