#include "gltf_subset.h"

#include <map>
#include <string_view>

namespace unseen::meshio::gltf {
namespace {

// Elements of one of the document's arrays that are taken over, in the order in which they are first named.
class Taken {
public:
    Taken(const json& document, const char* key) : all_(array_of(document, key)) {}

    // The new number. What is not there stays what it was: nobody can take it for another one.
    template <class Change>
    json number(const json& index, Change&& change) {
        const bool is_index = index.is_number_unsigned() && index.get<std::size_t>() < all_.size();
        if (!is_index) return index;
        const auto [entry, is_new] = numbers_.try_emplace(index.get<std::size_t>(), taken_.size());
        if (is_new) {
            taken_.push_back(all_[index.get<std::size_t>()]);
            from_.push_back(index.get<std::size_t>());
            json changed = taken_[entry->second];
            change(changed);
            taken_[entry->second] = std::move(changed);
        }
        return entry->second;
    }

    void put(json& out, const char* key) const {
        if (!taken_.empty()) out[key] = taken_;
    }
    const std::vector<std::size_t>& from() const { return from_; }

private:
    const json& all_;
    json taken_ = json::array();
    std::vector<std::size_t> from_;
    std::map<std::size_t, std::size_t> numbers_;
};

class Subsetter {
public:
    explicit Subsetter(const json& kept)
        : kept_(kept), materials_(kept, "materials"), textures_(kept, "textures"), samplers_(kept, "samplers"),
          images_(kept, "images") {}

    Subset run(const std::vector<SourceDocument::File>& files, std::size_t number) {
        json mesh = array_of(kept_, "meshes").at(number);
        for (json& primitive : mesh["primitives"])
            if (const auto material = primitive.find("material"); material != primitive.end())
                *material = materials_.number(*material, [&](json& of) { renumber_textures(of); });
        Subset subset;
        json& out = subset.document = json::object();
        for (const char* key : {"asset", "extensionsUsed", "extensionsRequired"})
            if (const json* value = member(kept_, key)) out[key] = *value;
        out["meshes"] = json::array({std::move(mesh)});
        materials_.put(out, "materials");
        textures_.put(out, "textures");
        samplers_.put(out, "samplers");
        images_.put(out, "images");
        for (const std::size_t from : images_.from())
            subset.files.push_back(from < files.size() ? files[from] : SourceDocument::File());
        return subset;
    }

private:
    // A material's textures are objects under keys that end so, with an index; extensions have such ones, too.
    void renumber_textures(json& value) {
        if (!value.is_structured()) return;
        for (auto& [key, inner] : value.items()) {
            if (key == "extras") continue;
            if (std::string_view(key).ends_with("Texture") && inner.is_object() && inner.contains("index"))
                inner["index"] = textures_.number(inner["index"], [&](json& texture) { renumber_sources(texture); });
            renumber_textures(inner);
        }
    }
    void renumber_sources(json& texture) {
        if (!texture.is_object()) return;
        const auto keep = [](json&) {};
        if (texture.contains("sampler")) texture["sampler"] = samplers_.number(texture["sampler"], keep);
        if (texture.contains("source")) texture["source"] = images_.number(texture["source"], keep);
        const auto extensions = texture.find("extensions");
        if (extensions == texture.end() || !extensions->is_object()) return;
        for (json& extension : *extensions)
            if (extension.is_object() && extension.contains("source"))
                extension["source"] = images_.number(extension["source"], keep);
    }

    const json& kept_;
    Taken materials_, textures_, samplers_, images_;
};

} // namespace

Subset subset_of(const json& kept, const std::vector<SourceDocument::File>& files, std::size_t mesh) {
    return Subsetter(kept).run(files, mesh);
}

} // namespace unseen::meshio::gltf
