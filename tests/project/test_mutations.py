"""The list of mutations is up to date. `tests/mutations/run.py` makes each and sees whether the tests notice."""

from pathlib import Path

import pytest
from commands import run_here
from mutations import run
from mutations.run import ROOT, Broken, Mutation, load


def test_every_mutation_still_applies_and_names_tests_that_there_are():
    mutations = load()
    assert len({mutation.name for mutation in mutations}) == len(mutations) >= 30
    for mutation in mutations:
        applied = mutation.applied()
        if mutation.file.endswith(".py"):
            compile(applied, mutation.file, "exec")
        assert mutation.old != mutation.new and mutation.tests, mutation.name
        for test in mutation.tests:
            file, _, name = test.partition("::")
            assert f"def {name.partition('[')[0]}" in (ROOT / file).read_text(), f"{mutation.name}: there is no {test}"


@pytest.mark.parametrize("text", ["", "a = 1\na = 1\n"])
def test_an_old_text_that_is_gone_or_stands_twice_is_said(tmp_path, text):
    Path(tmp_path, "module.py").write_text(text)
    with pytest.raises(Broken, match="exactly once in module.py"):
        Mutation("a name", "module.py", "a = 1", "a = 2", ["tests"]).applied(tmp_path)


def test_the_outcome_of_some_is_not_recorded_as_that_of_all(tmp_path):
    status, printed = run_here(run, "--only", "ifs", "--record", str(tmp_path / "all.jsonl"))
    assert status == 2 and "leave one of them out" in printed and not any(tmp_path.iterdir())
