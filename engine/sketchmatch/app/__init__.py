"""Requests of the contract, admitted, done somewhere and followed; no transport is known here.

The server's own process, in one event loop, passes bytes on: it admits requests, lets callers take
turns (``waiting``), and hands what workers say to readers (``tasks``). Each worker (``worker``) is
a process that decodes, matches and serialises one request at a time; as many begin as there are
processors, and once one turns out to be long it gives way and the next begins beside it, up to the
limit. Workers are forked from a process that holds the warm kernels (``template``), so one that is
lost, or does not stop when it is told to, is simply replaced (``workers``). Other people's plugins
get workers of their own kind, which are watched besides, and at most half of the places. Without
workers the same is done in threads of the server's process, and for the command line in its own.

Scenes are kept under the hash of what they are in one SQLite file (``scenes``, ``keeping``), which
workers read for themselves (``shelf``); what they remember of scenes (``remembered``) saves the
next request about the same ones that work. Sketches in progress (``sketches``) live in the event
loop, each with a runner that has its latest revision matched.
A match has a life beyond the call that began it (``matches``): whoever asks for it again under its
name reads the same one, and it is kept on disk (``archive``) by a thread that nobody waits for.
"""
