"""The modules that turn messages into values and values into messages, wherever they lie."""

from sketchmatch.server import requests, responses, status

__all__ = ["requests", "responses", "status"]
