// The judge's passes. Step by step they do what perception's judge does on the CPU (judge_modern.cpp there, which is the
// reference); shaders/planes.glsl says how numbers lie in textures.
#include <unseen/render/internal/visibility_passes.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <set>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/judge_tables.h>

#include "gpu_plane.h"
#include "shaders.h"

namespace unseen::render {
namespace {

constexpr std::size_t most_bands = 16;             // of pool.frag: what a fragment shader can read at least
constexpr std::size_t few_bands = 8;               // of its variant for usual sizes
constexpr std::size_t most_taps = 12;              // of blur.frag
constexpr int group_columns = 64, group_rows = 16; // of examine.comp

glm::ivec2 halved(glm::ivec2 size) { return (size + 1) / 2; }

glm::vec4 taps(const JudgeTables& tables) { return {tables.kernel[0], tables.kernel[1], tables.kernel[2], 0}; }

Result<void> check(const JudgeTables& t) {
    assert(!t.bands.empty() && t.bands.size() <= most_bands && t.luminances >= 2 && t.eccentricities >= 1);
    const std::size_t rows = static_cast<std::size_t>(t.eccentricities) * t.bands.size();
    const auto most = static_cast<std::size_t>(largest_target_side());
    if (static_cast<std::size_t>(t.luminances) > most || rows > most)
        return unsupported("judge: the tables are larger than this GPU's textures; judge on the CPU");
    return {};
}

// ---- what is in a picture ---------------------------------------------------------------------------------------------

struct Found { // as examine.comp has it
    std::uint32_t least = 0xffffffffU, largest = 0, not_below_1 = 0, first_bad = 0xffffffffU;
};

Buffer make_found() {
    Buffer buffer = Buffer::create("found in a picture");
    const Found nothing;
    glNamedBufferStorage(buffer.id(), sizeof(nothing), &nothing, GL_DYNAMIC_STORAGE_BIT);
    return buffer;
}

Result<const Program*> examining(const Context& context) {
    const ShaderSource source[] = {{ShaderSource::Stage::compute, shaders::examine_comp}};
    return context.impl().programs.named("examine", source);
}

void examine(const Program& program, PlanePasses& passes, const LuminanceTexture& picture, const Buffer& found) {
    const Found nothing;
    glNamedBufferSubData(found.id(), 0, sizeof(nothing), &nothing);
    passes.bind(0, picture.id);
    set_picture(program, picture);
    program.use();
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, found.id());
    glDispatchCompute(static_cast<GLuint>((picture.width + group_columns - 1) / group_columns),
                      static_cast<GLuint>((picture.height + group_rows - 1) / group_rows), 1);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, 0);
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
}

Found read(const Buffer& buffer) {
    Found found;
    glGetNamedBufferSubData(buffer.id(), 0, sizeof(found), &found);
    return found;
}

Result<void> check(const Found& found, int width, const char* which) {
    if (found.first_bad == Found{}.first_bad) return {};
    const auto columns = static_cast<std::uint32_t>(width);
    return judge_error("luminance of the " + std::string(which) + " at pixel (" +
                       std::to_string(found.first_bad % columns) + ", " + std::to_string(found.first_bad / columns) +
                       ") is negative or not finite");
}

} // namespace

// ---- LuminanceImage ---------------------------------------------------------------------------------------------------

struct LuminanceImage::Impl {
    Impl(const Context& context_, int width_, int height_)
        : context(context_), width(width_), height(height_), guard(context_) {}

    Result<void> set(std::span<const float> values) const {
        const auto wanted = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
        if (values.size() != wanted)
            return judge_error("a picture of " + size_text(width, height) + " pixels has " + std::to_string(wanted) +
                               " luminances, not " + std::to_string(values.size()));
        reset_pixel_stores();
        glTextureSubImage2D(texture.id(), 0, 0, 0, width, height, GL_RED, GL_FLOAT, values.data());
        return {};
    }

    Context context; // first, and so gone last
    int width, height;
    Texture2d texture;
    ContextGuard guard;
};

Result<LuminanceImage> LuminanceImage::create(const Context& context, int width, int height,
                                              std::span<const float> cdm2) {
    auto impl = std::make_unique<Impl>(context, width, height);
    auto made = in_context(context, "Making a picture", [&]() -> Result<void> {
        if (auto ok = check_size(width, height); !ok) return ok;
        impl->texture = Texture2d::create("luminance");
        glTextureStorage2D(impl->texture.id(), 1, GL_R32F, width, height);
        return impl->set(cdm2);
    });
    if (!made) return made.error();
    return LuminanceImage(std::move(impl));
}

Result<void> LuminanceImage::set(std::span<const float> cdm2) {
    return in_context(impl_->context, "Making a picture", [&] { return impl_->set(cdm2); });
}

LuminanceTexture LuminanceImage::texture() const noexcept {
    return {.id = impl_->texture.id(), .width = impl_->width, .height = impl_->height};
}

Result<LuminanceExtent> luminance_extent(const Context& context, const LuminanceTexture& picture, const char* which) {
    return in_context(context, "Looking at a picture", [&]() -> Result<LuminanceExtent> {
        if (auto ok = check_texture(picture); !ok) return ok.error();
        const auto program = examining(context);
        if (!program) return program.error();
        const Buffer buffer = make_found();
        PlanePasses passes(context.impl().programs);
        examine(**program, passes, picture, buffer);
        const Found found = read(buffer);
        if (auto ok = check(found, picture.width, which); !ok) return ok.error();
        return LuminanceExtent{std::bit_cast<float>(found.least), std::bit_cast<float>(found.largest)};
    });
}

// ---- VisibilityPasses -------------------------------------------------------------------------------------------------

struct VisibilityPasses::Impl {
    Impl(const Context& context_, const JudgeTables& tables_)
        : context(context_), tables(tables_), size(tables.width, tables.height), guard(context_) {}

    // A band of the reference.
    struct Band {
        glm::ivec2 size = {};
        GpuPlanes weights; // own, smoothed
    };
    // What judging needs. Planes that all levels use are as large as the largest of them.
    struct Judging {
        std::array<GpuPlanes, 3> differences; // of the first level, and of every second and third one
        GpuPlanes reduced, band, blurred_rows;
        std::array<GpuPlanes, 3> energies; // as they are, and halved by turns
        std::array<GpuPlanes, 3> blurred;  // by the window's Gaussians
        std::vector<GpuPlanes> powers;     // by band
        GpuPlanes visibility;
        Buffer found_in_test, found_visible;
    };
    enum class Sight { weights, thresholds };
    // What mapping and weighing need meanwhile.
    struct Scratch {
        GpuPlanes split, across, odd, even; // luminance and contrast; levels of the reference
        std::vector<GpuPlanes> steps;       // thresholds by band
        GpuPlanes packed;
    };

    Result<void> prepare(const LuminanceTexture& picture) {
        if (auto ok = check(tables); !ok) return ok;
        if (auto ok = check_picture(picture, size); !ok) return ok;
        PlanePrograms programs(context);
        programs.find(copy, "luminance", shaders::luminance_frag);
        if (auto ok = programs.result(); !ok) return ok;
        upload_nodes();
        if (auto ok = reference.need(size, 1, PlaneFormat::full, "reference"); !ok) return ok;
        bands.resize(tables.bands.size());
        for (std::size_t level = 0; level < bands.size(); ++level)
            bands[level].size = level == 0 ? size : halved(bands[level - 1].size);
        return copy_reference(picture);
    }

    Result<void> copy_reference(const LuminanceTexture& picture) {
        PlanePasses passes(context.impl().programs);
        set_picture(*copy, picture);
        passes.draw(*copy, reference, texels_of(size), {picture.id});
        passes_done += passes.count();
        return {};
    }

    Result<void> set_reference(const LuminanceTexture& picture) {
        if (auto ok = check_picture(picture, size); !ok) return ok;
        is_judged = is_weighed = false;
        keeps_scratch = true;
        present_maps.clear();
        return copy_reference(picture);
    }

    // What judging needs of the reference.
    Result<void> weigh_reference() {
        if (is_weighed) return {};
        if (auto ok = find_programs(Sight::weights); !ok) return ok;
        for (Band& band : bands)
            if (auto ok = band.weights.need(band.size, 2, PlaneFormat::full, "weights of a band"); !ok) return ok;
        PlanePasses passes(context.impl().programs);
        auto done = for_each_reference_band(passes, [&](std::size_t level, const GpuPlanes& of_reference) {
            see(passes, level, of_reference, Sight::weights, bands[level].weights);
        });
        end_scratch();
        passes_done += passes.count();
        is_weighed = static_cast<bool>(done);
        return done;
    }

    Result<void> need_scratch() {
        if (scratch) return {};
        const glm::ivec2 second = halved(size), third = halved(second);
        Scratch made;
        if (auto ok = made.split.need(size, 2, PlaneFormat::full, "luminance and contrast"); !ok) return ok;
        if (bands.size() > 1)
            for (const auto& [planes, pixels] :
                 {std::pair{&made.across, glm::ivec2(size.x, second.y)}, {&made.odd, second}, {&made.even, third}})
                if (auto ok = planes->need(pixels, 1, PlaneFormat::full, "levels of a reference"); !ok) return ok;
        scratch = std::move(made);
        return {};
    }

    void end_scratch() {
        if (!keeps_scratch) scratch.reset();
    }

    // Programs that nothing calls for are not compiled.
    Result<void> find_programs(Sight sight) {
        PlanePrograms programs(context);
        programs.find(unpack, "unpack", shaders::unpack_frag);
        programs.find(reduce_columns, "reduce columns", shaders::reduce_frag);
        programs.find(reduce_rows, "reduce rows", shaders::reduce_frag, {"ALONG_ROWS"});
        programs.find(split_reference, "split reference", shaders::split_frag, {"REFERENCE"});
        programs.find(split_base, "split base", shaders::split_frag, {"REFERENCE", "BASE"});
        if (sight == Sight::thresholds) {
            if (tables.gaze) programs.find(step, "step by gaze", shaders::sight_frag, {"THRESHOLDS", "GAZE"});
            else programs.find(step, "step", shaders::sight_frag, {"THRESHOLDS"});
            if (tables.bands.size() <= few_bands)
                programs.find(pool_thresholds, "pool 8 thresholds", shaders::pool_frag, {"THRESHOLDS", "UP_TO_8"});
            else programs.find(pool_thresholds, "pool thresholds", shaders::pool_frag, {"THRESHOLDS"});
        } else if (tables.gaze) programs.find(weigh, "weigh by gaze", shaders::sight_frag, {"GAZE"});
        else programs.find(weigh, "weigh", shaders::sight_frag);
        return programs.result();
    }

    void find_blurs(PlanePrograms& programs) {
        struct Blur {
            std::string_view rows, columns, reach;
        };
        constexpr Blur blurs[] = {{"blur rows by 4", "blur columns by 4", "REACH_1"},
                                  {"blur rows by 8", "blur columns by 8", "REACH_2"},
                                  {"blur rows by 11", "blur columns by 11", "REACH_3"}};
        for (std::size_t i = 0; i < blur_rows.size(); ++i) {
            programs.find(blur_rows[i], blurs[i].rows, shaders::blur_frag, {"ALONG_ROWS", blurs[i].reach});
            programs.find(blur_columns[i], blurs[i].columns, shaders::blur_frag, {blurs[i].reach});
        }
    }

    void upload_nodes() {
        std::vector<glm::vec4> texels;
        for (const JudgeTables::Band& band : tables.bands)
            for (const JudgeTables::Node& node : band.nodes)
                texels.emplace_back(node.log2_s, node.own, node.smoothed, 0);
        const auto rows = static_cast<GLsizei>(static_cast<std::size_t>(tables.eccentricities) * tables.bands.size());
        nodes = Texture2d::create("sensitivity");
        glTextureStorage2D(nodes.id(), 1, GL_RGBA32F, tables.luminances, rows);
        reset_pixel_stores();
        glTextureSubImage2D(nodes.id(), 0, 0, 0, tables.luminances, rows, GL_RGBA, GL_FLOAT, texels.data());
    }

    // Calls use(level, luminance and contrast) for each band.
    template <class Use>
    Result<void> for_each_reference_band(PlanePasses& passes, Use use) {
        if (auto made = need_scratch(); !made) return made;
        const GpuPlanes& split = scratch->split;
        unsigned fine = reference.texture();
        for (std::size_t level = 0; level < bands.size(); ++level) {
            const glm::ivec2 here = bands[level].size;
            if (level + 1 == bands.size()) {
                split_base->set(2, tables.floor_cdm2);
                passes.draw(*split_base, split, texels_of(here), {fine});
            } else {
                const GpuPlanes& next = level % 2 == 0 ? scratch->odd : scratch->even;
                reduce(passes, fine, here, scratch->across, next);
                split_reference->set(0, halved(here));
                split_reference->set(1, taps(tables));
                split_reference->set(2, tables.floor_cdm2);
                passes.draw(*split_reference, split, texels_of(here), {fine, next.texture()});
                fine = next.texture();
            }
            use(level, split);
        }
        return {};
    }

    void see(PlanePasses& passes, std::size_t level, const GpuPlanes& of_reference, Sight sight, const GpuPlanes& to) {
        const Program& program = sight == Sight::thresholds ? *step : *weigh;
        const Band& band = bands[level];
        program.set(0, band.size);
        program.set(1, glm::vec4(tables.masking_power, tables.masking_knee, tables.least_masker, tables.most_masker));
        program.set(2, glm::ivec2(tables.first_luminance, tables.luminances));
        program.set(3, glm::ivec2(static_cast<int>(level) * tables.eccentricities, tables.luminance_shift));
        program.set(4, tables.bands[level].of_patch);
        if (tables.gaze) {
            program.set(5, glm::vec4(tables.gaze->direction, static_cast<float>(tables.gaze->tangent_per_pixel)));
            program.set(6, glm::vec4(tables.first_eccentricity, 1 / tables.eccentricity_step,
                                     static_cast<float>(tables.eccentricities), 0));
            program.set(7, size);
            program.set(8, static_cast<unsigned>(level));
        }
        passes.draw(program, to, texels_of(band.size), {of_reference.texture(0), of_reference.texture(1), nodes.id()});
    }

    void reduce(PlanePasses& passes, unsigned from, glm::ivec2 from_size, const GpuPlanes& across,
                const GpuPlanes& to) {
        const glm::ivec2 across_size(from_size.x, halved(from_size).y);
        reduce_columns->set(0, from_size);
        reduce_columns->set(1, taps(tables));
        passes.draw(*reduce_columns, across, texels_of(across_size), {from});
        reduce_rows->set(0, across_size);
        reduce_rows->set(1, taps(tables));
        passes.draw(*reduce_rows, to, texels_of(halved(from_size)), {across.texture()});
    }

    Result<void> find_judging_programs() {
        PlanePrograms programs(context);
        programs.find(subtract, "difference", shaders::luminance_frag, {"DIFFERENCE"});
        programs.find(split_difference, "split difference", shaders::split_frag);
        programs.find(square, "energy", shaders::energy_frag);
        programs.find(halve, "halve", shaders::halve_frag);
        find_blurs(programs);
        if (tables.beta == 3.5f) programs.find(raise, "power 3.5", shaders::power_frag, {"EXPONENT_3_5"});
        else if (tables.beta == 2) programs.find(raise, "power 2", shaders::power_frag, {"EXPONENT_2"});
        else programs.find(raise, "power", shaders::power_frag);
        if (bands.size() <= few_bands) programs.find(pool_powers, "pool 8 powers", shaders::pool_frag, {"UP_TO_8"});
        else programs.find(pool_powers, "pool powers", shaders::pool_frag);
        if (auto ok = programs.result(); !ok) return ok;
        const auto found = examining(context);
        if (!found) return found.error();
        look = *found;
        return {};
    }

    Result<void> prepare_judging() {
        if (judging) return {};
        if (auto ok = find_judging_programs(); !ok) return ok;
        Judging made;
        Result<void> result;
        const auto make = [&](GpuPlanes& planes, glm::ivec2 pixels, PlaneFormat format, const char* label) {
            if (result) result = planes.need(pixels, 1, format, label);
        };
        const glm::ivec2 second = halved(size), third = halved(second);
        const bool has_levels = bands.size() > 1;
        make(made.differences[0], size, PlaneFormat::full, "difference");
        if (has_levels) {
            make(made.differences[1], second, PlaneFormat::full, "levels of a difference");
            make(made.differences[2], third, PlaneFormat::full, "levels of a difference");
            make(made.reduced, {size.x, second.y}, PlaneFormat::full, "levels of a difference");
            make(made.band, size, PlaneFormat::full, "band of a difference");
        }
        int halvings = 0;
        std::array<glm::ivec2, 3> largest = {glm::ivec2(1), glm::ivec2(1), glm::ivec2(1)};
        for (std::size_t level = 0; level < bands.size(); ++level)
            for (std::size_t i = 0; i < largest.size(); ++i) {
                const int of_this = tables.bands[level].window[i].halvings;
                glm::ivec2 pixels = bands[level].size;
                for (int h = 0; h < of_this; ++h) pixels = halved(pixels);
                largest[i] = glm::max(largest[i], pixels);
                halvings = std::max(halvings, of_this);
            }
        make(made.energies[0], size, PlaneFormat::full, "energy");
        if (halvings > 0) make(made.energies[1], second, PlaneFormat::full, "halved energy");
        if (halvings > 1) make(made.energies[2], third, PlaneFormat::full, "halved energy");
        glm::ivec2 widest(1);
        for (std::size_t i = 0; i < largest.size(); ++i) {
            make(made.blurred[i], largest[i], PlaneFormat::full, "blurred energy");
            widest = glm::max(widest, largest[i]);
        }
        make(made.blurred_rows, widest, PlaneFormat::full, "blurred energy");
        for (const Band& band : bands)
            make(made.powers.emplace_back(), band.size, PlaneFormat::full, "power of a band");
        make(made.visibility, size, PlaneFormat::single, "visibility");
        if (!result) return result;
        made.found_in_test = make_found();
        made.found_visible = make_found();
        judging = std::move(made);
        return {};
    }

    Result<void> judge(const LuminanceTexture& test) {
        if (auto ok = check_texture(test); !ok) return ok;
        if (test.width != size.x || test.height != size.y)
            return judge_error("the images differ in size: reference " + size_text(size.x, size.y) + ", test " +
                               size_text(test.width, test.height));
        if (auto ok = weigh_reference(); !ok) return ok;
        if (auto ok = prepare_judging(); !ok) return ok;
        const auto& j = *judging;
        PlanePasses passes(context.impl().programs);
        examine(*look, passes, test, j.found_in_test);
        set_picture(*subtract, test);
        passes.draw(*subtract, j.differences[0], texels_of(size), {test.id, reference.texture()});
        unsigned difference = j.differences[0].texture();
        for (std::size_t level = 0; level < bands.size(); ++level) {
            const Band& band = bands[level];
            unsigned here = difference;
            if (level + 1 < bands.size()) {
                const GpuPlanes& next = j.differences[level % 2 == 0 ? 1 : 2];
                reduce(passes, difference, band.size, j.reduced, next);
                split_difference->set(0, halved(band.size));
                split_difference->set(1, taps(tables));
                passes.draw(*split_difference, j.band, texels_of(band.size), {difference, next.texture()});
                here = j.band.texture();
                difference = next.texture();
            }
            square->set(0, band.size);
            square->set(1, glm::vec4(tables.most_thresholds, 0, 0, 0));
            passes.draw(*square, j.energies[0], texels_of(band.size),
                        {here, band.weights.texture(0), band.weights.texture(1)});
            add_energies(passes, level);
        }
        pool_powers->set(2, tables.beta);
        pool(passes, *pool_powers, j.powers, j.differences[0], j.visibility); // the difference is needed no more
        examine(*look, passes, {.id = j.visibility.texture(), .width = size.x, .height = size.y}, j.found_visible);
        passes_done += passes.count();
        return {};
    }

    // From the energies of a band to what the window holds of them, as powers.
    void add_energies(PlanePasses& passes, std::size_t level) {
        const auto& window = tables.bands[level].window;
        std::array<glm::ivec2, 3> sizes = {};
        const GpuPlanes* from = &judging->energies[0];
        glm::ivec2 from_size = bands[level].size;
        int halvings = 0;
        for (std::size_t i = window.size(); i-- > 0;) { // from the narrowest on
            // A narrower one is halved no more often than a wider one.
            for (; halvings < window[i].halvings; ++halvings) {
                const GpuPlanes& to = judging->energies[halvings % 2 == 0 ? 1 : 2];
                halve->set(0, from_size);
                from_size = halved(from_size);
                passes.draw(*halve, to, texels_of(from_size), {from->texture()});
                from = &to;
            }
            blur(passes, from->texture(), from_size, window[i].kernel, judging->blurred_rows, judging->blurred[i]);
            sizes[i] = from_size;
        }
        raise->set(0, glm::vec4(static_cast<float>(window[0].weight), static_cast<float>(window[1].weight),
                                static_cast<float>(window[2].weight), 0));
        raise->set(1, glm::vec4(window[0].halvings, window[1].halvings, window[2].halvings, tables.beta));
        for (std::size_t i = 0; i < sizes.size(); ++i) raise->set(2 + static_cast<int>(i), sizes[i]);
        const auto& blurred = judging->blurred;
        passes.draw(*raise, judging->powers[level], texels_of(bands[level].size),
                    {blurred[0].texture(), blurred[1].texture(), blurred[2].texture()});
    }

    // `rows`: for what is blurred along the rows alone.
    void blur(PlanePasses& passes, unsigned from, glm::ivec2 from_size, std::span<const float> kernel,
              const GpuPlanes& rows, const GpuPlanes& to) {
        std::array<float, most_taps> padded = {};
        std::copy(kernel.begin(), kernel.end(), padded.begin());
        const std::size_t reach = kernel.size() - 1, variant = reach <= 4 ? 0 : reach <= 8 ? 1 : 2;
        const std::span<const float> used(padded.data(), std::min(4 * variant + 5, most_taps));
        const auto pass = [&](const Program& program, unsigned source, const GpuPlanes& into) {
            program.set(0, from_size);
            program.set(1, used);
            passes.draw(program, into, texels_of(from_size), {source});
        };
        pass(*blur_rows[variant], from, rows);
        pass(*blur_columns[variant], rows.texture(), to);
    }

    // The shader reads all its textures, also those that it does not count.
    void pool(PlanePasses& passes, const Program& program, const std::vector<GpuPlanes>& from, const GpuPlanes& packed,
              const GpuPlanes& to) {
        for (std::size_t i = 0; i < (from.size() <= few_bands ? few_bands : most_bands); ++i)
            passes.bind(static_cast<unsigned>(i), from[std::min(i, from.size() - 1)].texture());
        program.set(0, size);
        program.set(1, static_cast<unsigned>(from.size()));
        passes.draw(program, packed, texels_of(size), {});
        passes.draw(*unpack, to, size, {packed.texture()});
    }

    Result<void> map_thresholds(int number) {
        if (present_maps.contains(number)) return {};
        if (auto ok = find_programs(Sight::thresholds); !ok) return ok;
        const auto map = maps.need(number, size);
        if (!map) return map.error();
        if (auto ok = need_scratch(); !ok) return ok;
        auto& steps = scratch->steps;
        steps.resize(bands.size());
        for (std::size_t level = 0; level < bands.size(); ++level)
            if (auto ok = steps[level].need(bands[level].size, 1, PlaneFormat::full, "thresholds of a band"); !ok)
                return ok;
        if (auto ok = scratch->packed.need(size, 1, PlaneFormat::full, "thresholds"); !ok) return ok;
        PlanePasses passes(context.impl().programs);
        auto done = for_each_reference_band(passes, [&](std::size_t level, const GpuPlanes& of_reference) {
            see(passes, level, of_reference, Sight::thresholds, steps[level]);
        });
        if (!done) return done;
        pool(passes, *pool_thresholds, steps, scratch->packed, **map);
        passes_done += passes.count();
        end_scratch();
        present_maps.insert(number);
        return {};
    }

    std::uint64_t texture_bytes() const {
        std::uint64_t bytes = reference.bytes() + maps.bytes();
        for (const Band& band : bands) bytes += band.weights.bytes();
        if (scratch) {
            for (const GpuPlanes* planes :
                 {&scratch->split, &scratch->across, &scratch->odd, &scratch->even, &scratch->packed})
                bytes += planes->bytes();
            for (const GpuPlanes& planes : scratch->steps) bytes += planes.bytes();
        }
        if (!judging) return bytes;
        for (const GpuPlanes* planes :
             {&judging->reduced, &judging->band, &judging->blurred_rows, &judging->visibility})
            bytes += planes->bytes();
        for (const auto* some : {&judging->differences, &judging->energies, &judging->blurred})
            for (const GpuPlanes& planes : *some) bytes += planes.bytes();
        for (const GpuPlanes& planes : judging->powers) bytes += planes.bytes();
        return bytes;
    }

    Context context; // first, and so gone last
    JudgeTables tables;
    glm::ivec2 size;
    Texture2d nodes; // of all bands
    GpuPlanes reference;
    std::vector<Band> bands;
    std::optional<Judging> judging;
    bool is_judged = false, is_weighed = false;
    std::optional<Scratch> scratch;
    bool keeps_scratch = false;
    ThresholdMaps maps;
    std::set<int> present_maps; // those that are of the present reference
    mutable int passes_done = 0;

    const Program *copy = nullptr, *subtract = nullptr, *reduce_rows = nullptr, *reduce_columns = nullptr,
                  *split_reference = nullptr, *split_base = nullptr, *split_difference = nullptr, *weigh = nullptr,
                  *step = nullptr, *square = nullptr, *halve = nullptr, *raise = nullptr, *pool_powers = nullptr,
                  *pool_thresholds = nullptr, *unpack = nullptr, *look = nullptr;
    std::array<const Program*, 3> blur_rows = {}, blur_columns = {};
    ContextGuard guard;
};

Result<VisibilityPasses> VisibilityPasses::create(const Context& context, const JudgeTables& tables,
                                                  const LuminanceTexture& reference) {
    auto impl = std::make_unique<Impl>(context, tables);
    auto made = in_context(context, "Preparing a judge's reference", [&] { return impl->prepare(reference); });
    if (!made) return made.error();
    return VisibilityPasses(std::move(impl));
}

Result<void> VisibilityPasses::judge(const LuminanceTexture& test) {
    impl_->is_judged = false; // whatever fails
    auto judged = in_context(impl_->context, "Judging", [&] { return impl_->judge(test); });
    impl_->is_judged = static_cast<bool>(judged);
    return judged;
}

Result<VisibilitySummary> VisibilityPasses::summary() const {
    if (!impl_->is_judged) return judge_error("no picture was judged yet");
    return in_context(impl_->context, "Reading a judgement", [&]() -> Result<VisibilitySummary> {
        if (auto ok = check(read(impl_->judging->found_in_test), impl_->size.x, "test"); !ok) return ok.error();
        const Found found = read(impl_->judging->found_visible);
        return VisibilitySummary{static_cast<double>(std::bit_cast<float>(found.largest)), found.not_below_1};
    });
}

Result<std::vector<float>> VisibilityPasses::read_visibility() const {
    if (auto ok = summary(); !ok) return ok.error();
    return in_context(impl_->context, "Reading a judgement",
                      [&] { return read_floats(impl_->judging->visibility.texture(), impl_->size); });
}

Result<void> VisibilityPasses::set_reference(const LuminanceTexture& reference) {
    return in_context(impl_->context, "Preparing a judge's reference", [&] { return impl_->set_reference(reference); });
}

Result<void> VisibilityPasses::map_thresholds(int number) {
    if (auto ok = ThresholdMaps::check(number); !ok) return ok;
    return in_context(impl_->context, "Mapping thresholds", [&] { return impl_->map_thresholds(number); });
}

Result<std::vector<float>> VisibilityPasses::read_thresholds(int number) const {
    return impl_->maps.read(impl_->context, number, impl_->size);
}

unsigned VisibilityPasses::thresholds_texture(int number) const noexcept { return impl_->maps.texture(number); }

int VisibilityPasses::full_screen_passes() const noexcept { return impl_->passes_done; }

std::uint64_t VisibilityPasses::texture_bytes() const noexcept { return impl_->texture_bytes(); }

} // namespace unseen::render
