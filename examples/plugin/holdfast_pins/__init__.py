"""A made-up skin with 2 x 3 taxels, as a plug-in of holdfast."""
