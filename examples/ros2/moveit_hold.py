"""Hand a grip over from MoveIt to `holdfast hold`, and back.

    gripper.close()                     # MoveIt: it waits until its goal has ended
    with Hold("builtin:any", "xela://auto", HAND):
        arm.move()                      # MoveIt; the grip is controlled meanwhile
    gripper.open()                      # MoveIt again

Run as a program, it is a node with the service `/holdfast/hold` (`std_srvs/SetBool`), for MoveIt
programs in C++: true takes over and answers when the grip is held, false gives back.

    python3 moveit_hold.py builtin:any xela://auto "ros2:width-gripper?..." --max-scale 2
"""

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

BEGIN_TIMEOUT = 60.0
"""Longest wait until the grip begins [s]."""
END_TIMEOUT = 10.0
"""Longest wait until the loop has ended [s]."""
POLL_TIME = 0.02
"""Time between two looks at the state [s]."""


class Hold:
    """`holdfast hold` in a process of its own, with its watchdog, for the time of a `with` block.

    Entering waits until the loop has the grip. Leaving ends the loop, and the gripper keeps its
    last command until the next one, which is MoveIt's. If the process dies, its watchdog sends
    the safe command.

    Args:
        model: model of the detector.
        source: URI of the sensors.
        hand: URI of the hand. Give a dry run first: this arms it.
        options: further options of `holdfast hold`, such as `--max-scale`, `2`.

    Attributes:
        state: state of the loop; FAULT if its process has ended.
    """

    def __init__(self, model: str, source: str, hand: str, *options: str) -> None:
        words = ["hold", model, source, "--hand", hand, "--armed", "--confirm", hand, "--json"]
        self._words = ["holdfast", *words, *options]  # in the PATH
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None
        self.state = "IDLE"

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def start(self) -> None:
        """Take over, and wait until the loop has the grip.

        Raises:
            RuntimeError: it has ended, or nothing is held; the gripper keeps its command.
        """
        self.state = "IDLE"
        self._process = subprocess.Popen(self._words, stdout=subprocess.PIPE, text=True)
        self._reader = threading.Thread(target=self._read, args=(self._process,), daemon=True)
        self._reader.start()
        end = time.monotonic() + BEGIN_TIMEOUT
        while self.state in ("IDLE", "FAULT"):
            if not self._reader.is_alive():
                self.stop()
                raise RuntimeError("holdfast hold has ended: its last line says why")
            if time.monotonic() > end:
                self.stop()
                raise RuntimeError(f"no stable grip in {BEGIN_TIMEOUT:g} s")
            time.sleep(POLL_TIME)

    def stop(self) -> None:
        """Give back: end the loop. The gripper keeps its last command."""
        process, self._process = self._process, None
        if process is None:
            return
        process.send_signal(signal.SIGINT)
        try:
            process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()  # the watchdog takes over
            process.wait()
        if self._reader is not None:
            self._reader.join()

    def _read(self, process: "subprocess.Popen[str]") -> None:
        """Follow the states, until the process ends."""
        if process.stdout is not None:
            with process.stdout as lines:
                for line in lines:
                    self.state = json.loads(line)["state"]
        self.state = "FAULT"


def answer(hold: Hold, request: Any, response: Any) -> Any:  # noqa: ANN401 (messages of std_srvs)
    """Answer a request of the service: take over, or give back."""
    try:
        if request.data:
            hold.start()
        else:
            hold.stop()
        response.success, response.message = True, hold.state
    except RuntimeError as failure:
        response.success, response.message = False, str(failure)
    return response


def main(words: list[str]) -> None:
    """Run the node until Ctrl-C."""
    import rclpy
    from rclpy.node import Node
    from std_srvs.srv import SetBool

    hold = Hold(*words)
    rclpy.init()
    node = Node("holdfast_hold")
    callback: Callable[..., Any] = lambda request, response: answer(hold, request, response)  # noqa: E731
    node.create_service(SetBool, "/holdfast/hold", callback)
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        hold.stop()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main(sys.argv[1:])
