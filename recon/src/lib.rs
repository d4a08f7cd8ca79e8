//! The Demeter plant model and everything geometric.
