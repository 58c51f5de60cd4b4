// A scene put together, and written as a binary glTF file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::app {

// Where something stands.
struct Place {
    glm::dvec3 at = glm::dvec3(0); // metres
    double turn_degrees = 0;       // about the vertical
    glm::dvec3 scale = glm::dvec3(1);
    double lean_degrees = 0; // to the side, before the turn
};

class SceneDraft {
public:
    // With normals where the mesh has some; `reflectance`: grey, 0..1. Returns the mesh's number.
    std::size_t add_mesh(std::string name, vdtree::Mesh mesh, double reflectance);
    void add(std::size_t mesh, std::string name, const Place& place, bool is_background = false);

    // Lux, from this direction; or candelas.
    void add_sun(glm::dvec3 towards, double lux, bool casts_shadow = false);
    void add_lamp(glm::dvec3 at, double candela, bool casts_shadow = false);
    void set_camera(glm::dvec3 eye, glm::dvec3 target, double fov_y_degrees);
    void set_light(double exposure, double ambient); // see meshio::SceneContents

    struct Mesh {
        std::string name;
        vdtree::Mesh mesh;
        double reflectance;
    };
    struct Node {
        std::size_t mesh;
        std::string name;
        Place place;
        bool is_background;
    };
    const std::vector<Mesh>& meshes() const { return meshes_; }
    const std::vector<Node>& nodes() const { return nodes_; }

    Result<void> write(const std::filesystem::path& file) const; // .glb

private:
    struct Light {
        bool is_sun;
        glm::dvec3 place; // or the direction towards it
        double intensity;
        bool casts_shadow;
    };
    std::vector<Mesh> meshes_;
    std::vector<Node> nodes_;
    std::vector<Light> lights_;
    glm::dvec3 eye_ = {0, 1.6, 5}, target_ = {0, 1, 0};
    double fov_y_degrees_ = 50, exposure_ = 1, ambient_ = 0.15;
};

} // namespace unseen::app
