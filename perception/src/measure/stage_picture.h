// Pictures of the whole mesh, folded or not, and the contrasts between two of them in bands of frequency: what a stage of
// folds changes is measured on these.
#pragma once

#include <optional>
#include <unordered_set>

#include "measure/fold_record.h"
#include "measure/pyramid.h"
#include "measure/texture_detail.h"

namespace unseen::perception {

// Where a picture is taken from: the mesh's sphere fills it, except for a margin. Lengths are in samples.
struct StageCamera {
    std::size_t number;
    glm::vec3 centre, right, up, towards;
    float samples_per_length;

    vdtree::Float4 place(const glm::vec3& p) const; // to the right, up, towards the eye
};
// Directions of a Fibonacci spiral over the sphere.
StageCamera stage_camera(const vdtree::Sphere& sphere, std::size_t number);

// The light that comes from each cell before an unlit background, and the share of the cell that the mesh covers.
struct StagePicture {
    Raster light{measurement::stage_side}, cover{measurement::stage_side};

    void subtract(const StagePicture& other);
};

inline constexpr std::size_t stage_samples = measurement::stage_side * measurement::cell_samples; // of a row

// The nearest surface at each sample, and the light that comes from it under each of several lights.
struct StageSurfaces {
    std::vector<float> height; // towards the eye; -infinity where nothing is
    std::array<std::vector<float>, LitStages::lights + 1> light;
    std::size_t drawn = 0;                  // samples, hidden ones too
    std::vector<std::uint16_t> rows_before; // by vertex: rows of samples below it; scratch

    void clear(std::size_t lights);
};

// A triangle in a picture.
struct StageFootprint {
    vdtree::Float4 a, b, c; // samples: to the right, up, towards the eye
    glm::vec2 v_by, w_by;   // how the shares of b and c grow, by sample
    std::size_t first, end; // rows
};

// The triangles that cover whole tiles of a picture, and how near the eye they are there: triangles behind them need
// not be drawn, so that no picture of large triangles behind or through each other costs their number times its
// samples.
class StageCovers {
public:
    static constexpr std::size_t tile = 16; // samples
    static constexpr std::size_t per_side = stage_samples / tile;

    StageCovers();
    void add(const StageFootprint& t, std::size_t number);

    // The tiles of a row where a triangle may be seen, a bit each. One that was added is not hidden by itself.
    std::uint64_t seen(const StageFootprint& t, std::size_t number, std::size_t row) const;

    // Whether a triangle, wide enough to matter, lies where an earlier one does that was asked about.
    bool repeats(const StageFootprint& t);

private:
    struct Cover {
        vdtree::Float4 height; // at the tile's corners
        std::size_t number;    // of the triangle
    };
    std::vector<Cover> covers_;              // by row and column
    std::unordered_set<std::string> places_; // bytes of corners
};

// Draws into memory that is used again for other pictures.
class StagePainter {
public:
    // `textures`: of all lights, or of each; refers to them.
    StagePainter(const vdtree::VertexTree& tree, std::span<const TexturedLight> textures, const StageCamera& camera,
                 StageSurfaces& surfaces);

    // A picture under each light of triangles over wedges. `luminance`: of a wedge under each light, relative.
    template <std::size_t lights>
    std::array<StagePicture, lights> draw(std::span<const vdtree::Triangle> triangles,
                                          const FunctionRef<std::array<float, lights>(vdtree::WedgeId)>& luminance);

    std::size_t drawn() const { return surfaces_.drawn; } // samples of the last picture, hidden ones too

private:
    void find_rows_before();
    std::optional<StageFootprint> footprint(const vdtree::Triangle& corners) const;
    template <std::size_t lights>
    std::array<StagePicture, lights> cells() const;

    std::span<const TexturedLight> textures_;
    const StageCamera& camera_;
    std::span<const glm::vec3> positions_;
    std::span<const glm::vec2> uvs_;
    vdtree::Closedness closedness_;
    StageSurfaces& surfaces_;
};
extern template std::array<StagePicture, 1>
StagePainter::draw(std::span<const vdtree::Triangle>, const FunctionRef<std::array<float, 1>(vdtree::WedgeId)>&);
extern template std::array<StagePicture, 3>
StagePainter::draw(std::span<const vdtree::Triangle>, const FunctionRef<std::array<float, 3>(vdtree::WedgeId)>&);
extern template std::array<StagePicture, 4>
StagePainter::draw(std::span<const vdtree::Triangle>, const FunctionRef<std::array<float, 4>(vdtree::WedgeId)>&);

// A picture, split into bands.
class StageBands {
public:
    struct Band {
        Raster light, cover;           // less the means
        Raster mean_light, mean_cover; // over wider areas
    };

    StageBands() = default;
    explicit StageBands(const StagePicture& picture);
    const Band& operator[](std::size_t band) const { return bands_[band]; }

    // Becomes the bands of a picture of the same surfaces with `share` times the one's light and `other_share` times
    // the other's.
    void set_to_sum(const StageBands& picture, float share, const StageBands& other, float other_share);

private:
    static Raster split(Raster& plane, Raster& mean); // takes the mean away; returns the next level

    std::array<Band, FoldStage::band_count> bands_;
};

// What the contrasts are relative to; relative luminances.
struct StageSurround {
    float brightest = 1;            // of what is behind the mesh
    float black = FoldStage::black; // added to the local mean
};

// Raises the stage's contrasts to those of a difference of pictures.
void add_contrasts(const StageBands& mesh, const StageBands& difference, const StageSurround& around, FoldStage& stage);

} // namespace unseen::perception
