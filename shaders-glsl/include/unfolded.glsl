// Values that decide a branch or a loop. Mesa's lavapipe (22.3, Debian 12's) folds push constants and uniforms that do so on
// their own into the kernel: it compiles it again at every dispatch, a millisecond, and keeps every copy, 60 KiB, until the
// pipeline goes. What a subgroup hands around it takes for computed. Other drivers see a uniform that stays one.

uint unfolded(uint x) { return subgroupBroadcastFirst(x); }
