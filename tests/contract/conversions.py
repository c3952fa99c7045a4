"""The modules that turn messages into values and values into messages, wherever they lie."""

from sketchmatch.app import requests, responses
from sketchmatch.server import status

__all__ = ["requests", "responses", "status"]
