//! The Volume Library Interface.
