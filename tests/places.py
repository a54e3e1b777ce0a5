"""Where the repository lies, for tests of what stands in it beside the package."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
