"""What a page may send, checked in whole before anything is begun. A message knows what it asks of a session."""

from __future__ import annotations

import reprlib
from collections.abc import Awaitable
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from ..errors import InputError
from ..ifs.code import IFS
from ..images.levels import Levels
from ..runtime.params import Params
from ..viewer.page import MOST_MAPS
from .reading import Reading

if TYPE_CHECKING:
    from .session import Session

MOST_SECONDS = 24 * 3600
LONGEST_MARK = 64

Pair = tuple[float, float]
Did = Awaitable[None] | None


class Settings(Params):
    """What a search takes from a page."""

    seconds: Annotated[float, Field(ge=1, le=MOST_SECONDS)] | None = None
    maps: Annotated[int, Field(ge=2, le=MOST_MAPS)] | None = None
    levels: Levels = "auto"


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Code(_Message):
    """A code as the editor of the page sends it: the package's plain data without notes and colours."""

    format: Literal["fractal-exp/ifs"]
    version: Literal[1]
    linear: Annotated[list[tuple[Pair, Pair]], Field(min_length=1, max_length=MOST_MAPS)]
    offset: Annotated[list[Pair], Field(max_length=MOST_MAPS)]
    probabilities: Annotated[list[float], Field(max_length=MOST_MAPS)] | None = None

    def made(self) -> IFS:
        """Raises `InputError` on what is no contractive code."""
        return IFS.from_json(self.model_dump())


def plain(code: IFS) -> dict[str, Any]:
    """A code as the editor of the page knows it."""
    return {name: part for name, part in code.to_json().items() if name in Code.model_fields}


class Plain(_Message):
    """What needs no more than its name."""

    do: Literal["stop", "go_on", "save", "back", "forth", "mend", "resume", "discard"]

    def carry_out(self, session: Session) -> Did:
        return getattr(session, self.do)()


class Read(_Message):
    """reading: fields of `Reading`, how the picture of the session is read anew."""

    do: Literal["read"]
    reading: dict[str, Any]

    def carry_out(self, session: Session) -> Did:
        return session.read(Reading(**self.reading))


class Search(_Message):
    """A search from the beginning, or a polish of the code as it is; settings: fields of `Settings`."""

    do: Literal["find", "polish"]
    settings: dict[str, Any] = {}

    def carry_out(self, session: Session) -> Did:
        return getattr(session, self.do)(Settings(**self.settings))


class Edit(_Message):
    """mark: by which the page knows the code again that it has sent."""

    do: Literal["edit"]
    code: Code
    mark: Annotated[str, Field(max_length=LONGEST_MARK)] = ""

    def carry_out(self, session: Session) -> Did:
        return session.edit(self.code.made(), self.mark)


class Choose(_Message):
    """index: of a code of the curve, which becomes the session's code."""

    do: Literal["choose"]
    index: int

    def carry_out(self, session: Session) -> Did:
        return session.choose(self.index)


Message = Plain | Read | Search | Edit | Choose
_any: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="do")])


def understood(text: str) -> Message:
    """The message in a text. Raises `InputError` on anything else, however deep, long or wide it is."""
    try:
        return _any.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"][1:])) or "the message"
        raise InputError(f"the page sent what the studio does not take ({where}: {first['msg']}, got "
                         f"{reprlib.repr(first['input'])}); load it again") from None
