"""The process that searches, so that a search can be stopped and never holds up the server.

Tasks go in and words come out by a pipe between this process and its parent; nobody else can write to it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from ..errors import InputError
from ..methods.base import Progress
from ..runtime import parent
from .tasks import Best, Done, Task, Told

WARM_SECONDS, WARM_SIDE = 0.5, 64   # of a search that only compiles what searches need, and of its picture
PATIENCE = 30.0                     # seconds that a search has to end after it was asked to,
LAST_PATIENCE = 5.0                 # and that the process has when the studio ends


class Ready:
    """The process can begin."""


Word = Ready | Told | Best | Done
Listener = Callable[[Word], object]


class Worker:
    """A process that does one task after another. listen: called with each word, in a thread of its own; a process that
    ends by itself, as where memory runs out, says a last `Done`, and another takes its place."""

    def __init__(self, listen: Listener, work: Callable[[Connection], None] | None = None):
        self._listen, self._work = listen, work or main
        self._closed = self._busy = False
        self._count = 0  # of tasks, so that the impatience with one does not end another
        self._lock = threading.Lock()
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._spoken = False
        self._process = context.Process(target=_follow, args=(self._work, theirs), name="studio search", daemon=True)
        self._process.start()
        theirs.close()
        threading.Thread(target=self._hear, args=(self._pipe, self._process), daemon=True).start()

    def do(self, task: Task) -> None:
        """Begin a task; the words come by and by. Raises `RuntimeError` if it is at another one."""
        packed = pickle.dumps(task)
        with self._lock:
            if self._busy or self._closed:
                raise RuntimeError("the worker is at a task, or closed")
            self._busy = True
            self._count += 1
            with contextlib.suppress(OSError):  # the thread that hears tells that the process is gone
                self._pipe.send_bytes(packed)

    def stop(self) -> None:
        """Ask the task to end with what it has. One that does not is ended by force after a while."""
        process = self._process
        if not self._busy or process.pid is None:
            return
        if not self._spoken:  # it would not know what an interrupt means, and has not begun
            return process.kill()
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)
        timer = threading.Timer(PATIENCE, self._force, args=(process, self._count))
        timer.daemon = True
        timer.start()

    def _force(self, process: Any, count: int) -> None:
        if self._busy and process is self._process and count == self._count:
            process.kill()

    def close(self) -> None:
        """End the process, by force if it does not end by itself, and at once if it has not begun."""
        with self._lock:
            self._closed = True
        if not self._spoken:
            self._process.kill()
        self.stop()
        with contextlib.suppress(OSError):
            self._pipe.send_bytes(pickle.dumps(None))
        for end in (self._process.terminate, self._process.kill):
            self._process.join(LAST_PATIENCE)
            if not self._process.is_alive():
                return
            end()

    def _hear(self, pipe: Connection, process: Any) -> None:
        while True:
            try:
                word: Word = pickle.loads(pipe.recv_bytes())
            except (EOFError, OSError):
                break
            self._spoken = True
            if isinstance(word, Done):
                self._busy = False
            self._listen(word)
        process.join()
        with self._lock:  # so that none is begun while the worker is closed
            if self._closed:
                return
            was_busy, began, self._busy = self._busy, self._spoken, False
            self._start()
        if was_busy:
            why = f"the search's process ended ({_end(process.exitcode)}); what the last stage found is kept"
            self._listen(Done(interrupted=began, why=why if began else ""))


def _end(code: int | None) -> str:
    return f"signal {-code}" if code is not None and code < 0 else f"status {code}"


class _Interruption:
    """SIGINT as KeyboardInterrupt while a task runs, and nothing else: a press on Stop that comes too late, or Ctrl-C
    in the terminal, which the server hears too, must not end the process."""

    def __init__(self) -> None:
        self.allowed = self.asked = False
        signal.signal(signal.SIGINT, self._come)

    def _come(self, *_: object) -> None:
        self.asked = True
        if self.allowed:
            raise KeyboardInterrupt

    def check(self) -> None:
        """Raise KeyboardInterrupt if it came and got lost, as in a function that C called."""
        if self.asked:
            raise KeyboardInterrupt


def _follow(work: Callable[[Connection], None], pipe: Connection) -> None:
    """Work, but no longer than the studio lives. The pipe alone would tell of its end only between two tasks."""
    parent.follow_starter()
    work(pipe)


def main(pipe: Connection) -> None:
    """What the process does."""
    interruption = _Interruption()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "SIGHUP"):  # of a closed terminal: the studio ends by it, and this process with the studio
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    from ..runtime import threads

    threads.use()
    _compile(pipe)
    _send(pipe, Ready())
    while True:
        try:
            task: Task | None = pickle.loads(pipe.recv_bytes())
        except (EOFError, OSError):
            return
        if task is None:
            return
        _send(pipe, _done(task, pipe, interruption))


def _done(task: Task, pipe: Connection, interruption: _Interruption) -> Done:
    def tell(word: Told | Best) -> None:
        interruption.allowed = False  # half a word would be the end of all talk
        _send(pipe, word)
        interruption.allowed = True
        interruption.check()

    interruption.asked = False
    try:
        interruption.allowed = True
        try:
            done = task.run(tell)
        finally:
            interruption.allowed = False
        return done
    except KeyboardInterrupt:
        return Done(interrupted=True)
    except InputError as error:
        return Done(why=str(error))
    except Exception as error:  # of whatever kind: the studio goes on, and says what it was
        return Done(interrupted=True, why=f"the search broke down: {type(error).__name__}: {error}")


def _send(pipe: Connection, word: Word) -> None:
    with contextlib.suppress(OSError):  # the parent is gone, and this process will see that
        pipe.send_bytes(pickle.dumps(word))


class _Wanted(Exception):
    """A task is waiting."""


def _compile(pipe: Connection) -> None:
    """Let a search of a small picture compile, or load, what the first one would wait for. It gives way to a task,
    whose first code needs less of it."""
    from .. import api, codes, suite

    def give_way(_: Progress | None = None) -> None:
        if pipe.poll():
            raise _Wanted

    with contextlib.suppress(_Wanted):
        give_way()
        target = suite.target(codes.known("sierpinski_triangle"), WARM_SIDE)
        api.invert(target, seconds=WARM_SECONDS, maps=3, on_step=give_way)
