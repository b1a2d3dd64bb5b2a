"""A worker whose starter was killed ends without a word."""

import signal
from multiprocessing import Pipe

from pcii.base.worker_processes import _work


class Killed:
    """A piece during which the process that asked for it is killed."""

    def __init__(self, other_end) -> None:
        self.other_end = other_end

    def __call__(self, piece: int) -> int:
        self.other_end.close()
        return piece

    def name(self, piece: int) -> str:
        return str(piece)

    def use_threads(self, count: int) -> None:
        pass


def test_worker_ends_when_nobody_waits_for_its_result():
    own, other = Pipe()
    other.send(0)
    handler = signal.getsignal(signal.SIGINT)
    try:
        _work(own, Killed(other), threads=1)
    finally:
        signal.signal(signal.SIGINT, handler)
