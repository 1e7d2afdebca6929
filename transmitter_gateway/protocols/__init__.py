"""One file per radio behind the `RadioProtocol` interface."""
