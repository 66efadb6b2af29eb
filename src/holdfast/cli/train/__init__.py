"""The verb `holdfast train`, and its options."""
