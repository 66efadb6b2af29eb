"""A recording of a real hand that ships with holdfast.

`box-slips.mcap`: a robot carries a box between two uSkin 4x4 sensors until it slips and falls,
4.8 s at 60 Hz, with the authors' labels. Sequence 2022-02-22-08-10-01 of `imanlab/
proactive-slip-control` (Nazari, Mandil and Ghalamzan, CoRL 2022), commit 73c84b0, under the MIT
licence in `LICENSE.box-slips`; imported by `holdfast import`, without the poses of the robot.
"""

from importlib.resources import files
from pathlib import Path

BOX_SLIPS = Path(str(files(__name__) / "box-slips.mcap"))
