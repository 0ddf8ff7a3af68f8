// See shutter.h.
#include "host/solve/shutter.h"

namespace rig {

Pose moved_by(const Pose& rig_from_body, const Vector6& velocity, double s)
{
    return {rotation_exp(s * velocity.head<3>()) * rig_from_body.rotation,
            rig_from_body.translation_mm + s * velocity.tail<3>()};
}

}  // namespace rig
