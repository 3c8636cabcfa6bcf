"""The playground: a page in the browser where anyone can throw, built on viser.

`settings` is what the page's controls say, `thrown` makes a run of it, `player` shows the run at
the pace of the clock, and only `tab` and `server` know viser.
"""
