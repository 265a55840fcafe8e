"""The heat method: Newton steps on a conductor network, coarse to fine."""
