"""`python -m buildarena_cli`: the command line without its script."""

from buildarena_cli.main import run

if __name__ == "__main__":
    run()
