"""The guided protocol of `holdfast teach`: its steps, their course and the folder of grasps."""
