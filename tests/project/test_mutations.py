"""The list of mutations is up to date. `tests/mutations/run.py` makes each and sees whether the tests notice."""

from mutations.run import ROOT, load


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
