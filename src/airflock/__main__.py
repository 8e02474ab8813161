"""`python -m airflock` is the command `airflock`."""

from airflock.cli.main import main

if __name__ == "__main__":
    main()
