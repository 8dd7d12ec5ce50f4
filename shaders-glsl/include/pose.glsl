// What is learnt of the poses of the cameras.

// vec4 of a camera: turn, shift, each with 1 - beta_1^steps; first moments of both. Behind the last camera, of all together: second
// moments of turn and shift, 1 - beta_2^steps.
const uint POSE_ROWS = 4u;
const float POSE_MOST_TURN = 0.2;      // radians
