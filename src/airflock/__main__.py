"""`python -m airflock` is the command `airflock`."""

from airflock.cli import main

if __name__ == "__main__":
    main()
