//! Settler: rigid bodies come to rest on the table (rapier3d, convex parts by parry3d).
