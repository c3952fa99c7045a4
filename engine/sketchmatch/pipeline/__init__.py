"""segment → describe → relate → search → map: a match from sources to result.

It knows no transport. Every stage that can take long is a generator that yields while it works,
so that whoever drives it can show progress, and stops it by closing it.
"""
