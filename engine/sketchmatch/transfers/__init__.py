"""Points, routes and zones carried from one scene to another, through the objects of both."""
