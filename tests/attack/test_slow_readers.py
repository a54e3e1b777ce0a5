"""Readers take time and memory in proportion to a text, whoever wrote it, and say which bound a text goes beyond."""

import pytest
from slow_readers import KINDS, READERS, growth, memory

from fractal_exp import InputError

STEEPEST = 4          # times as long for a byte in a text of eight times the length
FATTEST = 40          # bytes of memory for a byte of a text
LONGEST = 2**24       # bytes


QUICK = {"fractint": ("a number of digits and x", "a number of digits, e, x", "closed braces", "comments"),
         "table": ("maps", "spaced commas", "spaces before a comment", "text between"),
         "flame": ("coefs of digits and x", "flames", "edits", "zero variations", "a long palette", "turned maps"),
         "json": ("keys", "keys twice at the end", "linear", "rows")}


@pytest.mark.parametrize("reader", QUICK)
def test_time_grows_with_the_length_of_a_text_and_no_faster(reader):
    for kind in QUICK[reader]:
        times, size, took = growth(reader, kind, longest=2**15)
        assert times < STEEPEST, f"{kind}: {took:.3f} s for {size} bytes, {times:.1f} times that of a shorter text"


@pytest.mark.parametrize(("reader", "kind", "bound"), [
    ("fractint", "closed braces", "more than 10000 codes"), ("flame", "flames", "more than 10000 codes"),
    ("fractint", "numbers in a line", "more than 130000 numbers; a code has from 1 to 10000 maps"),
    ("table", "maps", "from 1 to 10000 maps"), ("flame", "turned maps", "from 1 to 10000 maps"),
    ("flame", "good maps", "from 1 to 10000 maps"), ("flame", "attributes", "at most 1000 are"),
    ("json", "rows", "from 1 to 10000 maps, got"),
    ("json", "offsets", "ifs_t must hold at most 100000 lists and numbers"),
])
def test_a_refusal_says_which_bound_was_met(reader, kind, bound):
    texts, read = READERS[reader]
    with pytest.raises(InputError, match=bound):
        read(texts[kind](2**20).encode())


@pytest.mark.slow
@pytest.mark.parametrize(("reader", "kind"), KINDS)
def test_the_longest_files_take_seconds_and_no_gigabyte(reader, kind):
    times, size, took = growth(reader, kind, longest=LONGEST)
    assert times < STEEPEST, f"{took:.3f} s for {size} bytes, {times:.1f} times as much a byte as in shorter"
    assert memory(reader, kind, LONGEST) < FATTEST
