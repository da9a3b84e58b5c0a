"""``python -m femtune``."""

from femtune.cli import main

if __name__ == "__main__":
    main(prog_name="femtune")
