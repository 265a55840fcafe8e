"""The engine process and the folder of one request. GI-free."""
