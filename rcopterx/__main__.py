"""`python -m rcopterx`: the command line."""

from rcopterx.cli import main

if __name__ == "__main__":
    main()
