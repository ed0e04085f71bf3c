// SPDX-License-Identifier: Apache-2.0
#include "cli/photo_words.h"

namespace nerfvdb {

void PhotoWords::add(CLI::App& command) {
    command.add_option("--downscale", downscale_,
                       "Photographs of half, a quarter or an eighth of the width and height: means of the light of 2x2, 4x4 "
                       "or 8x8 pixels of the originals (folders such as images_2 are not looked at) [1]")
        ->check(CLI::IsMember({1, 2, 4, 8}))
        ->type_name("N");
    CLI::Option* const masks = command.add_flag(
        "--alpha-masks", alpha_masks_,
        "Alpha is a mask: pixels that are more than half transparent do not count. Else they show that nothing of the scene is "
        "there");
    command.add_flag("--no-alpha", no_alpha_, "Photographs with alpha are laid on white, and nobody is told where they were transparent")
        ->excludes(masks);
    command.add_flag("--no-masks", no_masks_,
                     "Every pixel counts. Else those do not that are black in a photograph's mask, masks/NAME.png or "
                     "masks/NAME.jpg.png beside the images");
}

void PhotoWords::apply(DatasetOptions& options) const {
    options.downscale = downscale_;
    options.use_masks = !no_masks_;
    options.alpha_masks = alpha_masks_;
    options.no_alpha = no_alpha_;
}

}  // namespace nerfvdb
