"""Texts made to be slow, or large in memory, for whoever reads them; how time and memory grow with their length."""

import gc
import time
import tracemalloc

from fractal_exp import InputError
from fractal_exp.ifs.formats import FORMATS, choose
from fractal_exp.runtime.files import parse_json

SHORTEST = 2**9    # bytes, of the first text of each kind
ENOUGH = 0.1       # seconds of the processor's time after which no longer text is tried
MEASURED = 0.05    # seconds for which a text is read again and again: some clocks tick only a hundred times a second
SHORTER = 8        # times, than the longest text, is the text that it is compared with
ROW, XFORM = "0.5 0 0 0.5 0 0 1\n", '<xform weight="1" linear="1" coefs=".5 0 0 .5 0 0"/>'


def repeated(piece, before="", after=""):
    """Texts of any length: a piece, over and over."""
    return lambda size: f"{before}{piece * ((size - len(before) - len(after)) // len(piece))}{after}"


def numbered(piece, before="", after=""):
    """The same with another number in each piece."""
    return lambda size: before + "".join(piece.format(i) for i in range(size // (len(piece) + 4))) + after


WORDS = {"digits": repeated("1"), "digits and x": repeated("1", after="x"), "dots": repeated("1."),
         "digits, e, x": repeated("1", after="e+x"), "zeros": repeated("0", before="0.", after="1"),
         "signs": repeated("-"), "long exponent": repeated("0", before="1e", after="1"), "spaces": repeated(" ", "1")}
FRACTINT = {
    **{f"a number of {name}": (lambda size, word=word: f"a {{ 0 0 0 0 0 0 {word(size)} }}")
       for name, word in WORDS.items()},
    "closed braces": repeated("{}"), "open braces": repeated("{"), "closing braces": repeated("}"),
    "empty lines": repeated("\n"), "lines": repeated("ab\n"), "lines in an entry": repeated("ab\n", "a {", "}"),
    "empty lines in an entry": repeated("\n", "a {", "}"), "numbers in a line": repeated("10 ", "a {", "}"),
    "maps": repeated(ROW, "a {\n", "}"), "entries": repeated(f"a {{ {ROW}}}\n"),
    "comments": repeated(";ab\n", "a {", "}"),
    "empty comments": repeated(";\n", "a {", "}"), "a long comment": repeated("a ", "a {;", "\n}"),
    "a long name": repeated("a ", "", "{ 1 }"), "names": numbered("n{} {{}}"), "signs of 0": repeated("\x1a", "a {}"),
}
TABLES = {
    **{f"a number of {name}": (lambda size, word=word: f"0 0 0 0 0 0 {word(size)}") for name, word in WORDS.items()},
    "maps": repeated(ROW), "numbers in a line": repeated("10 "), "commas": repeated(","),
    "spaced commas": repeated(" ,"), "commas in words": repeated("1,", before="1 2 "), "semicolons": repeated("1;"),
    "comments": repeated("#\n"),
    "spaces before a comment": repeated(" ", after="#"), "tabs": repeated("\t\n"), "words": repeated("a b c d e f p\n"),
    "a count": repeated("1\n"), "a decimal comma": repeated("0,5 0,5\n"), "letters": repeated("é"),
    "text between": repeated("ab ;c\n#d\n", after="\na { 0 0 0 0 0 0 }"), "lists": repeated("[", before=" "),
}
FLAMES = {
    **{f"coefs of {name}": (lambda size, word=word: f'<flame><xform coefs="1 0 0 1 0 {word(size)}"/></flame>')
       for name, word in WORDS.items()},
    "flames": repeated("<flame/>", "<f>", "</f>"), "maps": repeated("<xform/>", "<flame>", "</flame>"),
    "good flames": repeated(f"<flame>{XFORM}</flame>", "<f>", "</f>"),
    "good maps": repeated(XFORM, "<flame>", "</flame>"),
    "edits": repeated("<a/>", f"<flame><edit>{'<a>' * 60}", f"{'</a>' * 60}</edit></flame>"),
    "others": repeated("<a/>", "<f>", "</f>"), "others in a flame": repeated("<a/>", "<flame>", "</flame>"),
    "attributes": numbered('a{}="" ', "<flame><xform ", "/></flame>"),
    "zero variations": numbered('a{}="0" ', '<flame><xform linear="1" coefs="1 0 0 1 0 0" ', "/></flame>"),
    "xaos": repeated("1 ", '<flame><xform chaos="', '"/></flame>'),
    "a long name": repeated("a ", '<flame name="', '"/>'), "text": repeated("a ", "<flame>", "</flame>"),
    "a long tag": repeated("a", "<", "/>"), "newlines": repeated("\n", "<flame>", "</flame>"),
    "palette": repeated('<color index="0" rgb="1 2 3"/>', "<flame>", "</flame>"),
    "palettes": repeated('<palette format="RGB">00</palette>', "<flame>", "</flame>"),
    "a long palette": repeated("0\n", '<flame><palette format="RGB">', "</palette></flame>"),
    "a long colour": repeated("1 ", '<flame><color index="0" rgb="', '"/></flame>'),
    "a long kind": repeated("1", '<flame><symmetry kind="', '"/></flame>'),
    "turned maps": repeated(XFORM, '<flame><symmetry kind="-9"/>', "</flame>"),
    "attributes of a flame": numbered('a{}="x" ', "<flame ", f">{XFORM}</flame>"),
    "colours": repeated(XFORM.replace(" w", ' color="0" w'), '<flame><colors data="0011223344556677"/>', "</flame>"),
}
OWN = '{"format":"fractal-exp/ifs","version":1,"linear":['
WHOLE = f'{OWN}[[0,0],[0,0]]],"offset":[[0,0]],'
JSON = {
    "lists": repeated("[],", "[", "[]]"), "objects": repeated("{},", "[", "{}]"),
    "numbers": repeated("0.5,", "[", "0]"), "keys": numbered('"{}":0,', "{", '"":0}'),
    "keys twice at the end": numbered('"{}":0,', "{", '"x":0,"x":0}'),
    "one key": repeated('"a":0,', "{", '"a":0}'), "digits": repeated("1", "[", "]"),
    "a fraction": repeated("1", "[0.", "]"), "rows": repeated("[0.5,0,0,0.5,0,0],", "[", "[0,0,0,0,0,0]]"),
    "depth": repeated("["), "texts": repeated('"ab",', "[", "0]"), "spaces": repeated(" ", "[", "]"),
    "lists in a map": repeated("[],", "[[", "0]]"), "numbers in a map": repeated("0,", "[[", "0]]"),
    "linear": repeated("[[0,0],[0,0]],", OWN, '[[0,0],[0,0]]],"offset":[[0,0]]}'),
    "offsets": repeated("[0,0],", '{"ifs_m":[[0,0,0,0]],"ifs_t":[', "[0,0]]}"),
    "probabilities": repeated("0,", '{"ifs_m":[[0,0,0,0]],"ifs_t":[[0,0]],"ifs_p":[', "1]}"),
    "colours": repeated("[0,0,0],", f'{WHOLE}"colours":{{"blends":[1],"rgb":[', "[0,0,0]]}}"),
    "notes": repeated("a ", f'{WHOLE}"meta":{{"name":"', '"}}'), "a wrong key": repeated("a ", '{"', '":0}'),
    "wrong keys": numbered('"{}":0,', "{", '"":0}'), "a wrong version": repeated("a ", '{"format":"', '"}'),
}


def code_in(key):
    """A reader of the first code, or of the only one, in a file's bytes."""
    def read(data):
        entries = FORMATS[key].entries(data)
        return choose(entries, "#1" if FORMATS[key].several else None)
    return read


READERS = {"fractint": (FRACTINT, code_in("fractint")), "table": (TABLES, code_in("table")),
           "flame": (FLAMES, code_in("flame")), "json": (JSON, code_in("json")),
           "plain json": (JSON, lambda data: parse_json(data, "the file"))}
KINDS = [(reader, kind) for reader, (texts, _) in READERS.items() for kind in texts]


def reading(reader, kind, size):
    """Make a text of about this many bytes; what reads it, or refuses it in one short line."""
    texts, read = READERS[reader]
    data = texts[kind](size).encode()

    def once():
        try:
            read(data)
        except InputError as error:
            assert len(str(error)) < 1000 and "\n" not in str(error), str(error)[:2000]
    return once


def seconds(work):
    """The processor's time for it, without the garbage collector's rounds, which come when they come."""
    gc.disable()
    started, times = time.process_time(), 0
    while times == 0 or time.process_time() - started < MEASURED:
        work()
        times += 1
    gc.enable()
    return (time.process_time() - started) / times


def growth(reader, kind, longest):
    """How many times longer a byte takes in a long text than in one of an eighth of it: about 1 where the time grows
    with the length, and 8 where it grows with its square; the length in bytes, and the time for all of it. The long
    text is the first to take long enough, or the longest."""
    size = SHORTEST
    while (took := seconds(reading(reader, kind, size))) < ENOUGH and SHORTER * size <= longest:
        size *= SHORTER
    return took / seconds(reading(reader, kind, size // SHORTER)) / SHORTER, size, took


def memory(reader, kind, size):
    """The bytes of memory that a byte of the text takes at most while it is read."""
    work = reading(reader, kind, size)
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / size
