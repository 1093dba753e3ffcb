"""The sequence of a soft toy and a sponge: tracked as it is, at its rate, with parts missing, and the sponge alone."""
