"""`python -m sommerl` and the command `sommerl`."""

import sys


def main() -> int:
    """Runs the command line; an interruption counts from the first moment, also while modules are being loaded."""
    try:
        from .cli import main as run

        return run()
    except KeyboardInterrupt:
        print("error: interrupted; nothing was left half-written", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
