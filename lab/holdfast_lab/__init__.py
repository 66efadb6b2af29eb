"""The laboratory of holdfast: the study, the comparison of grip laws, and their reports."""

import holdfast as holdfast  # before matplotlib, whose settings in the working folder it ignores
