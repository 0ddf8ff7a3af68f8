"""What every generator does with its text: writes it, or with --check holds the committed file to it."""
import sys
from pathlib import Path


def keep(output, text, doc, agrees=None):
    """The command line of a generator whose file is `output` and whose text `text()` makes. `agrees()`: whether the
    file may stay, where that is not equality. Prints the generator's `doc` for anything else."""
    if sys.argv[1:] == ["--check"]:
        if not (agrees() if agrees else output.exists() and output.read_text() == text()):
            sys.exit(f"{output} is not what tools/gen/{Path(sys.argv[0]).name} writes; run it")
    elif not sys.argv[1:]:
        output.write_text(text())
    else:
        print(doc)
        sys.exit(0 if sys.argv[1:] == ["--help"] else 2)
