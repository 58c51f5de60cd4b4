// Scenes from glTF files.
#pragma once

#include <unseen/session/scene.h>

namespace unseen::session {

// Of a file that SceneFile has read, as Scene::load() says.
Result<Scene> scene_from(meshio::SceneFile file, const std::filesystem::path& name, const LoadOptions& options);

} // namespace unseen::session
