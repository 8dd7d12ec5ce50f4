// What is learnt of the poses of the cameras.

// vec4 of a camera: turn and number of steps, shift; first moments of both. Behind the last camera: second moments of turn and shift,
// number of steps, of all cameras together.
const uint POSE_ROWS = 4u;
const float POSE_MOST_TURN = 0.2;      // radians
