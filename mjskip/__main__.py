"""python -m mjskip is mjskip."""

from mjskip.cli import main

main()
