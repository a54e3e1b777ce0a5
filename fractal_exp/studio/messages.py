"""What a page may send, checked in whole before anything is begun. A message knows what it asks of a session."""

from __future__ import annotations

import reprlib
from collections.abc import Awaitable
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from ..errors import InputError
from .keeping import Code
from .reading import Reading
from .tasks import Settings

if TYPE_CHECKING:
    from .session import Session

LONGEST_MARK = 64

Did = Awaitable[None] | None


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


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


class Colour(_Message):
    """yes: whether codes have the colours of the picture, the present one and those to come."""

    do: Literal["colour"]
    yes: bool

    def carry_out(self, session: Session) -> Did:
        return session.colour(self.yes)


Message = Plain | Read | Search | Edit | Choose | Colour
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
