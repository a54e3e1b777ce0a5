"""The one kind of error that a user can mend."""


class InputError(ValueError):
    """What was given cannot be used. The message says what was expected, what was got, and the remedy.

    Command lines print it as one line; any other exception is a defect of this package and keeps its traceback.
    """
