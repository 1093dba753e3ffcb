"""Everything between the processes: sessions, publications, subscriptions and queries, and frames on top of them."""
