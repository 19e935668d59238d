// Members of the installed Scene.
#pragma once

#include "engine/api/scene.h"
#include "engine/scene/scene.h"

namespace clearance {

struct Scene::Impl {
  engine::Scene scene;
};

}  // namespace clearance
