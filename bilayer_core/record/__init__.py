"""Observers and the log: the topic table, CDR encoders, the MCAP recorder and its reader, frames kept in memory."""
