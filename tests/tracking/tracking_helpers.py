"""How the tests of tracking look into a store, and stand between it and a run."""

from fractal_exp.tracking import store
from fractal_exp.tracking.outbox import Patience

IMPATIENT = Patience(0.002, 0.01)      # outages last milliseconds,
AT_ONCE = Patience(0.002, 0.01, 0.1)   # and a run that has ended gives up at once


class Between:
    """A client in front of the real one that counts calls, and fails each of `failing` while `away` says so."""

    def __init__(self, uri, failing=(), away=lambda: False):
        self.real, self.failing, self.away, self.calls = store.connect(uri), failing, away, []

    def __getattr__(self, name):
        value = getattr(self.real, name)
        if not callable(value):
            return value

        def call(*args, **kwargs):
            self.calls.append((name, kwargs))
            if name in self.failing and self.away():
                raise ConnectionError("refused by the test")
            return value(*args, **kwargs)
        return call


def get(uri, run_id):
    return store.connect(uri).get_run(run_id)


def artifacts(uri, run_id, folder=None):
    return {item.path for item in store.connect(uri).list_artifacts(run_id, folder)}
