// Columns of pictures under a title, each with two lines above it.
#pragma once

#include <string>
#include <vector>

#include <unseen/perception/image.h>

namespace unseen::app {

struct PictureColumn {
    std::string name, verdict;
    std::vector<perception::Image> pictures = {}; // code values, from top to bottom
};

// As wide as the widest picture or line of text, for all columns. Code values.
Result<perception::Image> compose_columns(const std::string& title, const std::vector<PictureColumn>& columns);

} // namespace unseen::app
