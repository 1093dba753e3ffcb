"""Communication between the processes: sessions, publishers, subscriptions, queries, and frames on top of them."""
