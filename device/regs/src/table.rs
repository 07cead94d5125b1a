//! The register table: every register of the card, once.
//!
//! Decode, trace, driver and the register chapter of the programming manual come from here. Each register is a
//! module of its own with its fields: `volume_size_xy::REGISTER`, `volume_size_xy::X`.

use crate::frame_registers::VIEW_START;
use crate::register::{Access, Field, Register};

macro_rules! registers {
    ($(
        $module:ident $name:literal $access:ident $offset:literal $([$count:literal by $stride:literal])?
        = $reset:literal, $meaning:literal {
            $($field:ident $low:literal +$bits:literal $format:ident $text:literal)*
        }
    )*) => {
        $(
            #[doc = $meaning]
            pub mod $module {
                use super::*;
                /// The register itself.
                pub const REGISTER: Register = Register {
                    name: $name,
                    offset: $offset,
                    count: { let count = 1; $(let _ = count; let count = $count;)? count },
                    stride: { let stride = 4; $(let _ = stride; let stride = $stride;)? stride },
                    access: Access::$access,
                    reset: $reset,
                    fields: &[$($field),*],
                    meaning: $meaning,
                };
                $(
                    #[doc = $text]
                    pub const $field: Field = Field {
                        name: stringify!($field),
                        register: $offset,
                        low: $low,
                        bits: $bits,
                        format: crate::number::$format,
                        meaning: $text,
                    };
                )*
            }
        )*

        /// All registers, by offset.
        pub static REGISTERS: &[Register] = &[$($module::REGISTER),*];
    };
}

registers! {
    // The status block: what the card copies to host memory whenever it changes.
    status "STATUS" ReadOnly 0x000 = 0x0000_0000,
    "State of the card. A change of any word of the status block raises SEQUENCE; the copy in host memory is \
     complete once its SEQUENCE is new." {
        BUSY 0 +1 CODE "A command waits or runs."
        QUEUE_FULL 1 +1 CODE "The last command found the queue full and was dropped."
        MISTAKE 2 +1 CODE "Strict mode has seen a programming mistake since it was acknowledged."
        FRAME_PENDING 4 +1 CODE "A frame ended since it was acknowledged."
        TRANSFER_PENDING 5 +1 CODE "A transfer ended since it was acknowledged."
        FAULT_PENDING 6 +1 CODE "A command was refused or failed since it was acknowledged."
        SEQUENCE 16 +16 INTEGER "Number of changes of the status block, modulo 65536."
    }
    last_fault "LAST_FAULT" ReadOnly 0x004 = 0x0000_0000,
    "The last refused or failed command, of whatever kind; zero after reset." {
        CODE_OF 0 +8 CODE "Fault code; 0 is none."
        BIT 8 +5 INTEGER "Lowest bit of the field to blame."
        OFFSET 16 +16 INTEGER "Offset of the register to blame."
    }
    completed "COMPLETED" ReadOnly 0x008 = 0x0000_0000,
    "Commands that ended since reset, well or not, modulo 2^32." {
        COUNT 0 +32 INTEGER "Number of commands."
    }
    mistakes "MISTAKES" ReadOnly 0x00c = 0x0000_0000,
    "Programming mistakes since reset; counted in strict mode only." {
        COUNT 0 +32 INTEGER "Number of mistakes."
    }
    transfer_state "TRANSFER_STATE" ReadOnly 0x010 = 0x0000_0000,
    "The last transfer that ended." {
        TAG 0 +16 INTEGER "Tag of its command."
        RESULT 16 +8 CODE "0 none yet, 1 done, 2 failed (see TRANSFER_FAULT)."
    }
    transfer_fault "TRANSFER_FAULT" ReadOnly 0x014 = 0x0000_0000,
    "Why the last transfer failed, as in LAST_FAULT." {
        CODE_OF 0 +8 CODE "Fault code; 0 is none."
        BIT 8 +5 INTEGER "Lowest bit of the field to blame."
        OFFSET 16 +16 INTEGER "Offset of the register to blame."
    }
    plane_state "PLANE_STATE" ReadOnly 0x040 [16 by 4] = 0x0000_0000,
    "The last frame that ended, for each 32-bit base plane; a frame of a wider format is found at the first \
     32-bit base plane that it covers. A frame has ended when the tag is that of its start command; tags of \
     consecutive frames on one base plane must differ. A start command whose base plane does not exist shows up \
     in LAST_FAULT alone." {
        TAG 0 +16 INTEGER "Tag of its start command."
        RESULT 16 +8 CODE "0 none yet, 1 done, 2 failed (see PLANE_FAULT)."
    }
    plane_fault "PLANE_FAULT" ReadOnly 0x080 [16 by 4] = 0x0000_0000,
    "Why the last frame of each base plane failed, as in LAST_FAULT; places as in PLANE_STATE." {
        CODE_OF 0 +8 CODE "Fault code; 0 is none."
        BIT 8 +5 INTEGER "Lowest bit of the field to blame."
        OFFSET 16 +16 INTEGER "Offset of the register to blame."
    }

    // Control of the card as a whole.
    reset "RESET" WriteOnly 0x100 = 0x0000_0000,
    "Brings the card into power-on state; commands that wait or run are cancelled. Mapped memories keep their \
     contents." {
        KEY 0 +32 INTEGER "0x52455345 resets; anything else is a mistake and ignored."
    }
    cancel "CANCEL" WriteOnly 0x104 = 0x0000_0000,
    "Cancels commands that wait or run; each ends with fault `cancelled`." {
        PLANES 0 +16 CODE "Bit b: frames on base plane b; places as in PLANE_STATE."
        TRANSFERS 16 +1 CODE "All transfers."
    }
    interrupt_enable "INTERRUPT_ENABLE" WriteOnly 0x108 = 0x0000_0000,
    "Which causes raise an interrupt. With fewer vectors granted all causes share vector 0." {
        FRAME 4 +1 CODE "A frame ended (vector 0)."
        TRANSFER 5 +1 CODE "A transfer ended (vector 1)."
        FAULT 6 +1 CODE "A command was refused or failed (vector 2)."
    }
    acknowledge "ACKNOWLEDGE" WriteOnly 0x10c = 0x0000_0000,
    "Clears the bits of STATUS that are written as one." {
        QUEUE_FULL 1 +1 CODE "Clears QUEUE_FULL."
        MISTAKE 2 +1 CODE "Clears MISTAKE."
        FRAME 4 +1 CODE "Clears FRAME_PENDING."
        TRANSFER 5 +1 CODE "Clears TRANSFER_PENDING."
        FAULT 6 +1 CODE "Clears FAULT_PENDING."
    }
    status_address_low "STATUS_ADDRESS_LOW" WriteOnly 0x110 = 0x0000_0000,
    "Bus address of the status block's copy in host memory (192 bytes), lower half." {
        ADDRESS 4 +28 INTEGER "Bits 31..4 of the address; it is a multiple of 16."
    }
    status_address_high "STATUS_ADDRESS_HIGH" WriteOnly 0x114 = 0x0000_0000,
    "Bus address of the status block's copy in host memory, upper half." {
        ADDRESS 0 +32 INTEGER "Bits 63..32 of the address."
    }
    status_control "STATUS_CONTROL" WriteOnly 0x118 = 0x0000_0000,
    "Writing it starts or stops the copying; starting copies at once." {
        ENABLE 0 +1 CODE "Copy the status block to host memory whenever it changes. The word STATUS is written \
                         last."
    }

    // Transfer of a rectangle of a base plane to host memory.
    transfer_address_low "TRANSFER_ADDRESS_LOW" WriteOnly 0x120 = 0x0000_0000,
    "Bus address of the rectangle's first pixel, lower half." {
        ADDRESS 0 +32 INTEGER "Bits 31..0 of the address."
    }
    transfer_address_high "TRANSFER_ADDRESS_HIGH" WriteOnly 0x124 = 0x0000_0000,
    "Bus address of the rectangle's first pixel, upper half." {
        ADDRESS 0 +32 INTEGER "Bits 63..32 of the address."
    }
    transfer_pitch "TRANSFER_PITCH" WriteOnly 0x128 = 0x0000_0000,
    "Bytes from one row in host memory to the next." {
        BYTES 0 +24 INTEGER "At least the width times the bytes of a pixel."
    }
    transfer_origin "TRANSFER_ORIGIN" WriteOnly 0x12c = 0x0000_0000,
    "First pixel of the rectangle." {
        COLUMN 0 +10 INTEGER "0..=511."
        ROW 16 +10 INTEGER "0..=511."
    }
    transfer_size "TRANSFER_SIZE" WriteOnly 0x130 = 0x0000_0000,
    "Size of the rectangle." {
        WIDTH 0 +10 INTEGER "Columns, 1..=512."
        HEIGHT 16 +10 INTEGER "Rows, 1..=512."
    }
    transfer "TRANSFER" WriteOnly 0x134 = 0x0000_0000,
    "Writing it queues a transfer of the rectangle; it waits for earlier frames on the same base plane." {
        PLANE 0 +4 INTEGER "Base plane, counted in the size of its format."
        PLANE_FORMAT 4 +2 CODE "Format of the base plane: 0 RGBA8, 1 64-bit accumulators."
        PIXEL_FORMAT 8 +4 CODE "Format in host memory, as numbered by the VLI."
        TAG 16 +16 INTEGER "Shows up in TRANSFER_STATE at the end."
    }

    // What the card is.
    interface_version "INTERFACE_VERSION" ReadOnly 0x180 = 0x0001_0000,
    "Version of this programming interface. A driver refuses another major version." {
        MINOR 0 +16 INTEGER "Raised by additions."
        MAJOR 16 +16 INTEGER "Raised by changes."
    }
    renderer "RENDERER" ReadOnly 0x184 = 0x0000_0000,
    "Which renderer the card runs." {
        KIND 0 +8 CODE "1 reference, 2 optimised."
    }
    architecture "ARCHITECTURE" ReadOnly 0x188 = 0x0000_0000,
    "Which architecture the card is." {
        KIND 0 +8 CODE "1 vg500."
    }
    simd_level "SIMD_LEVEL" ReadOnly 0x18c = 0x0000_0000,
    "Vector instructions that the engine uses." {
        LEVEL 0 +8 CODE "0 portable, 1 AVX2, 2 AVX-512."
    }
    threads "THREADS" ReadOnly 0x190 = 0x0000_0000,
    "Threads that render." {
        COUNT 0 +16 INTEGER "At least 1."
    }
    voxel_memory_size "VOXEL_MEMORY_SIZE" ReadOnly 0x194 = 0x0000_0000,
    "Size of voxel memory." {
        BYTES 0 +32 INTEGER "Bytes."
    }
    trapped_reads "TRAPPED_READS" ReadOnly 0x1a0 [6 by 4] = 0x0000_0000,
    "Reads of each base address register that came as a message since the connection began, modulo 2^32." {
        COUNT 0 +32 INTEGER "Number of accesses."
    }
    trapped_writes "TRAPPED_WRITES" ReadOnly 0x1c0 [6 by 4] = 0x0000_0000,
    "Writes of each base address register that came as a message since the connection began, modulo 2^32." {
        COUNT 0 +32 INTEGER "Number of accesses."
    }

    // The frame: the volume.
    volume_base "VOLUME_BASE" WriteOnly 0x200 = 0x0000_0000,
    "Where the volume begins in voxel memory." {
        OFFSET 0 +32 INTEGER "Bytes; a multiple of the voxel size."
    }
    volume_format "VOLUME_FORMAT" WriteOnly 0x204 = 0x0000_0000,
    "How voxels are stored." {
        FORMAT 0 +2 CODE "1 UINT8 (value << 4), 2 UINT12L (low 12 bits of 16), 3 UINT12U (high 12 bits of 16); 0 is \
                         no volume and refused."
    }
    volume_size_xy "VOLUME_SIZE_XY" WriteOnly 0x208 = 0x0000_0000,
    "Real size of the volume along object x and y. Reads past it replicate the outermost voxel." {
        X 0 +9 INTEGER "Voxels, 1..=256."
        Y 16 +9 INTEGER "Voxels, 1..=256."
    }
    volume_size_z "VOLUME_SIZE_Z" WriteOnly 0x20c = 0x0000_0000,
    "Real size of the volume along object z." {
        Z 0 +9 INTEGER "Voxels, 1..=256."
    }
    volume_pitch "VOLUME_PITCH" WriteOnly 0x210 = 0x0000_0000,
    "Padded dimensions of the store in which the volume lies: x fastest, then y, then z." {
        ROW 0 +16 INTEGER "Voxels from one row to the next, a multiple of 32, at least the size along x."
        ROWS 16 +16 INTEGER "Rows from one slice to the next, a multiple of 32, at least the size along y."
    }
    subvolume_x "SUBVOLUME_X" WriteOnly 0x220 = 0x7fff_8000,
    "Active sub-volume along object x: samples outside are invisible, their neighbours are real voxels." {
        MIN 0 +16 VOXEL "Lowest voxel, inclusive."
        MAX 16 +16 VOXEL "Highest voxel, inclusive."
    }
    subvolume_y "SUBVOLUME_Y" WriteOnly 0x224 = 0x7fff_8000,
    "Active sub-volume along object y." {
        MIN 0 +16 VOXEL "Lowest voxel, inclusive."
        MAX 16 +16 VOXEL "Highest voxel, inclusive."
    }
    subvolume_z "SUBVOLUME_Z" WriteOnly 0x228 = 0x7fff_8000,
    "Active sub-volume along object z." {
        MIN 0 +16 VOXEL "Lowest voxel, inclusive."
        MAX 16 +16 VOXEL "Highest voxel, inclusive."
    }
    block_x "BLOCK_X" WriteOnly 0x230 = 0xffff_0000,
    "Block range along object x: only samples at LOW <= position < HIGH are visible, so that blocks of a larger \
     volume never composite a shared slice twice." {
        LOW 0 +16 INTEGER "Voxel coordinate, inclusive."
        HIGH 16 +16 INTEGER "Voxel coordinate, exclusive."
    }
    block_y "BLOCK_Y" WriteOnly 0x234 = 0xffff_0000,
    "Block range along object y." {
        LOW 0 +16 INTEGER "Voxel coordinate, inclusive."
        HIGH 16 +16 INTEGER "Voxel coordinate, exclusive."
    }
    block_z "BLOCK_Z" WriteOnly 0x238 = 0xffff_0000,
    "Block range along object z." {
        LOW 0 +16 INTEGER "Voxel coordinate, inclusive."
        HIGH 16 +16 INTEGER "Voxel coordinate, exclusive."
    }

    // The frame: illumination.
    material "MATERIAL" WriteOnly 0x240 = 0x0000_00ff,
    "Reflection coefficients. With diffuse and specular zero the frame is not illuminated." {
        EMISSIVE 0 +8 FACTOR "ke."
        DIFFUSE 8 +8 FACTOR "kd."
        SPECULAR 16 +8 FACTOR "ks."
    }
    specular_color "SPECULAR_COLOR" WriteOnly 0x244 = 0x00ff_ffff,
    "Colour of specular highlights." {
        RED 0 +8 FACTOR "Red."
        GREEN 8 +8 FACTOR "Green."
        BLUE 16 +8 FACTOR "Blue."
    }
    modulation "MODULATION" WriteOnly 0x248 = 0x0000_0000,
    "What is multiplied with the gradient magnitude as mapped by the gradient-magnitude table." {
        OPACITY 0 +1 CODE "Opacity (Go)."
        DIFFUSE 1 +1 CODE "Diffuse illumination (Gmim_d)."
        SPECULAR 2 +1 CODE "Specular illumination (Gmim_s)."
    }

    // The frame: cropping, in object voxel space.
    crop_flags "CROP_FLAGS" WriteOnly 0x250 = 0x0000_0000,
    "Cropping. Each of three terms is the intersection of its enabled slabs, inverted on demand; an empty term is \
     everything." {
        TERM_0 0 +4 CODE "x slab, y slab, z slab, invert."
        TERM_1 4 +4 CODE "x slab, y slab, z slab, invert."
        TERM_2 8 +4 CODE "x slab, y slab, z slab, invert."
        OR 12 +1 CODE "0: a sample is visible in the intersection of the terms; 1: in their union."
        INVERT 13 +1 CODE "Inverts the result. All bits zero: no cropping."
    }
    crop_min_x "CROP_MIN_X" WriteOnly 0x254 = 0x0000_0000, "Lower face of the x slab." {
        BOUND 0 +32 BOUND "Inclusive."
    }
    crop_max_x "CROP_MAX_X" WriteOnly 0x258 = 0x0000_0000, "Upper face of the x slab." {
        BOUND 0 +32 BOUND "Inclusive."
    }
    crop_min_y "CROP_MIN_Y" WriteOnly 0x25c = 0x0000_0000, "Lower face of the y slab." {
        BOUND 0 +32 BOUND "Inclusive."
    }
    crop_max_y "CROP_MAX_Y" WriteOnly 0x260 = 0x0000_0000, "Upper face of the y slab." {
        BOUND 0 +32 BOUND "Inclusive."
    }
    crop_min_z "CROP_MIN_Z" WriteOnly 0x264 = 0x0000_0000, "Lower face of the z slab." {
        BOUND 0 +32 BOUND "Inclusive."
    }
    crop_max_z "CROP_MAX_Z" WriteOnly 0x268 = 0x0000_0000, "Upper face of the z slab." {
        BOUND 0 +32 BOUND "Inclusive."
    }

    // The frame: the cut plane, in object voxel space.
    cut_control "CUT_CONTROL" WriteOnly 0x280 = 0x0000_0000,
    "Cut plane: the slab DMIN <= Ax + By + Cz <= DMAX." {
        ENABLE 0 +1 CODE "The cut plane is on."
        OUTSIDE 1 +1 CODE "0: samples inside the slab are visible; 1: outside."
    }
    cut_normal_xy "CUT_NORMAL_XY" WriteOnly 0x284 = 0x0000_0000, "Normal of the cut plane." {
        A 0 +16 CUT_COEFFICIENT "Coefficient of x."
        B 16 +16 CUT_COEFFICIENT "Coefficient of y."
    }
    cut_normal_z "CUT_NORMAL_Z" WriteOnly 0x288 = 0x0000_0000, "Normal of the cut plane." {
        C 0 +16 CUT_COEFFICIENT "Coefficient of z."
    }
    cut_min_low "CUT_MIN_LOW" WriteOnly 0x28c = 0x0000_0000, "DMIN, lower word." {
        WORD 0 +32 CUT_DISTANCE "Bits 31..0."
    }
    cut_min_high "CUT_MIN_HIGH" WriteOnly 0x290 = 0x0000_0000, "DMIN, upper word." {
        WORD 0 +32 CUT_DISTANCE "Bits 63..32."
    }
    cut_max_low "CUT_MAX_LOW" WriteOnly 0x294 = 0x0000_0000, "DMAX, lower word." {
        WORD 0 +32 CUT_DISTANCE "Bits 31..0."
    }
    cut_max_high "CUT_MAX_HIGH" WriteOnly 0x298 = 0x0000_0000, "DMAX, upper word." {
        WORD 0 +32 CUT_DISTANCE "Bits 63..32."
    }
    cut_falloff "CUT_FALLOFF" WriteOnly 0x29c = 0x0000_0000,
    "Transition from full opacity to none, outside of both faces." {
        RECIPROCAL 0 +17 CUT_RECIPROCAL "1 / width."
    }

    // The frame: the cursor, in object voxel space.
    cursor_control "CURSOR_CONTROL" WriteOnly 0x2a0 = 0x0000_0000, "The three-dimensional cursor." {
        ENABLE_X 0 +1 CODE "The part along x, or the plane across it."
        ENABLE_Y 1 +1 CODE "The part along y, or the plane across it."
        ENABLE_Z 2 +1 CODE "The part along z, or the plane across it."
        PLANES 4 +1 CODE "0 cross hair, 1 planes."
        EXCLUDE_OVERLAP 5 +1 CODE "Nothing is drawn where two parts meet."
        DISABLE_CROP 6 +1 CODE "The cursor is drawn where the volume is cropped or cut away, too."
        WIDTH 8 +3 INTEGER "Voxels: 1, 3, 5 or 7."
    }
    cursor_length "CURSOR_LENGTH" WriteOnly 0x2a4 = 0x0000_0000, "Length of the cross hair's parts." {
        LENGTH 0 +16 INTEGER "Voxels; 0 is without end."
    }
    cursor_x "CURSOR_X" WriteOnly 0x2a8 = 0x0000_0000, "Centre of the cursor." {
        POSITION 0 +32 BOUND "Object x."
    }
    cursor_y "CURSOR_Y" WriteOnly 0x2ac = 0x0000_0000, "Centre of the cursor." {
        POSITION 0 +32 BOUND "Object y."
    }
    cursor_z "CURSOR_Z" WriteOnly 0x2b0 = 0x0000_0000, "Centre of the cursor." {
        POSITION 0 +32 BOUND "Object z."
    }
    cursor_color_x "CURSOR_COLOR_X" WriteOnly 0x2b4 = 0x0000_0000, "Colour of the part for x." {
        RED 0 +8 FACTOR "Red."
        GREEN 8 +8 FACTOR "Green."
        BLUE 16 +8 FACTOR "Blue."
        OPACITY 24 +8 FACTOR "Opacity."
    }
    cursor_color_y "CURSOR_COLOR_Y" WriteOnly 0x2b8 = 0x0000_0000, "Colour of the part for y." {
        RED 0 +8 FACTOR "Red."
        GREEN 8 +8 FACTOR "Green."
        BLUE 16 +8 FACTOR "Blue."
        OPACITY 24 +8 FACTOR "Opacity."
    }
    cursor_color_z "CURSOR_COLOR_Z" WriteOnly 0x2bc = 0x0000_0000, "Colour of the part for z." {
        RED 0 +8 FACTOR "Red."
        GREEN 8 +8 FACTOR "Green."
        BLUE 16 +8 FACTOR "Blue."
        OPACITY 24 +8 FACTOR "Opacity."
    }

    // The frame: what changes with the view. The start command closes the group.
    table_select "TABLE_SELECT" WriteOnly 0x3c8 = 0x0000_0000,
    "Which of its two copies each table is read from. A frame that runs is not disturbed: it took its tables \
     with its start command." {
        COLOR 0 +1 CODE "Colour table."
        OPACITY 1 +1 CODE "Opacity table."
        DIFFUSE 2 +1 CODE "Diffuse reflectance map."
        SPECULAR 3 +1 CODE "Specular reflectance map."
        GRADIENT_MAGNITUDE 4 +1 CODE "Gradient-magnitude table."
    }
    permutation "PERMUTATION" WriteOnly 0x3cc = 0x0000_0210,
    "Object axis and direction that each permuted axis follows; permuted z runs away from the viewer." {
        X_AXIS 0 +2 CODE "0 x, 1 y, 2 z."
        X_FLIP 2 +1 CODE "From the high end to the low end."
        Y_AXIS 4 +2 CODE "0 x, 1 y, 2 z."
        Y_FLIP 6 +1 CODE "From the high end to the low end."
        Z_AXIS 8 +2 CODE "0 x, 1 y, 2 z."
        Z_FLIP 10 +1 CODE "From the high end to the low end."
    }
    supersampling "SUPERSAMPLING" WriteOnly 0x3d0 = 0x0000_0001,
    "Supersampling along permuted z." {
        Z 0 +4 INTEGER "Sample slices per voxel slice, 1..=8."
    }
    start_x "START_X" WriteOnly 0x3d4 = 0x0000_0000,
    "Where the ray of base-plane pixel (0, 0) passes the first slice." {
        POSITION 0 +32 RAY_POSITION "Permuted x."
    }
    start_y "START_Y" WriteOnly 0x3d8 = 0x0000_0000,
    "Where the ray of base-plane pixel (0, 0) passes the first slice." {
        POSITION 0 +32 RAY_POSITION "Permuted y."
    }
    step_x "STEP_X" WriteOnly 0x3dc = 0x0000_0000, "What rays advance from one sample slice to the next." {
        STEP 0 +23 RAY_STEP "Permuted x."
    }
    step_y "STEP_Y" WriteOnly 0x3e0 = 0x0000_0000, "What rays advance from one sample slice to the next." {
        STEP 0 +23 RAY_STEP "Permuted y."
    }
    eye_xy "EYE_XY" WriteOnly 0x3e4 = 0x0000_0000,
    "Direction towards the eye, for reflection. Frames with a specular coefficient want a square of its length within \
     1/1024 of 1." {
        X 0 +16 EYE "Object x."
        Y 16 +16 EYE "Object y."
    }
    eye_z "EYE_Z" WriteOnly 0x3e8 = 0x0000_0000, "Direction towards the eye, for reflection." {
        Z 0 +16 EYE "Object z."
    }
    base_plane_size "BASE_PLANE_SIZE" WriteOnly 0x3ec = 0x0000_0000,
    "Rays of the frame. Exactly this rectangle of the base plane is written." {
        WIDTH 0 +10 INTEGER "Columns of rays, 1..=512."
        HEIGHT 16 +10 INTEGER "Rows of rays, 1..=512."
    }
    accumulators "ACCUMULATORS" WriteOnly 0x3f0 = 0x0000_0000,
    "Where rays begin: empty, or with the accumulators of an earlier frame." {
        ENABLE 0 +1 CODE "Begin with the accumulators of base plane SOURCE, which has this frame's format; it may \
                         be the base plane that is rendered into. Not with RGBA8."
        SOURCE 8 +4 INTEGER "Base plane, counted in the size of the format."
    }
    output "OUTPUT" WriteOnly 0x3f4 = 0x0000_0000, "How rays are blended and stored." {
        BLEND 0 +2 CODE "0 alpha blending, 1 MIP, 2 MinIP, 3 weighted sum."
        PLANE_FORMAT 4 +2 CODE "0 RGBA8, 1 64-bit accumulators (not for the weighted sum), 2 128-bit sums (only for \
                               the weighted sum)."
        SECTIONS 8 +1 CODE "Work section by section, 32 voxels wide, through section memory. Pixels are the same."
        CURSOR_ONLY 9 +1 CODE "Blend only the cursor over the accumulators of an earlier frame, which `ACCUMULATORS` \
                               gives. Not in alpha blending."
    }
    keep "KEEP" WriteOnly 0x3f8 = 0x0000_0000,
    "What is not to be left out. No pixel depends on it: it tells what an omission is worth." {
        OMISSIONS 0 +32 CODE "Bits as in `REPORT_OMITTED`. The engine does without the omissions that are set here, \
                              and leaves out what else it can; it has no way to do without those of stages that are \
                              off, but for illumination, gradients and modulation."
    }
    start "START" WriteOnly 0x3fc = 0x0000_0000,
    "Writing it queues a frame of what the frame registers hold. Registers and tables may be written again at \
     once (strict mode names tables written while a frame that uses them runs); voxel memory is read while the \
     frame runs." {
        PLANE 0 +4 INTEGER "Base plane to render into, counted in the size of its format."
        VOXELS_UNCHANGED 8 +1 CODE "Promise that voxel memory has not changed since the last frame of this volume."
        TAG 16 +16 INTEGER "Shows up in PLANE_STATE at the end."
    }

    // The report block of each base plane: about its last frame that ended; places as in PLANE_STATE.
    report_tag "REPORT_TAG" ReadOnly 0x1000 [16 by 128] = 0x0000_0000,
    "Which frame the report is about; places as in PLANE_STATE." {
        TAG 0 +16 INTEGER "Tag of its start command."
    }
    report_samples_low "REPORT_SAMPLES_LOW" ReadOnly 0x1008 [16 by 128] = 0x0000_0000,
    "Samples that exist on the frame's rays, lower word." { WORD 0 +32 INTEGER "Bits 31..0." }
    report_samples_high "REPORT_SAMPLES_HIGH" ReadOnly 0x100c [16 by 128] = 0x0000_0000,
    "Samples that exist on the frame's rays, upper word." { WORD 0 +32 INTEGER "Bits 63..32." }
    report_processed_low "REPORT_PROCESSED_LOW" ReadOnly 0x1010 [16 by 128] = 0x0000_0000,
    "Samples that were processed, lower word." { WORD 0 +32 INTEGER "Bits 31..0." }
    report_processed_high "REPORT_PROCESSED_HIGH" ReadOnly 0x1014 [16 by 128] = 0x0000_0000,
    "Samples that were processed, upper word." { WORD 0 +32 INTEGER "Bits 63..32." }
    report_time_low "REPORT_TIME_LOW" ReadOnly 0x1018 [16 by 128] = 0x0000_0000,
    "Time in the engine, lower word." { WORD 0 +32 INTEGER "Nanoseconds, bits 31..0." }
    report_time_high "REPORT_TIME_HIGH" ReadOnly 0x101c [16 by 128] = 0x0000_0000,
    "Time in the engine, upper word." { WORD 0 +32 INTEGER "Nanoseconds, bits 63..32." }
    report_cycles_low "REPORT_CYCLES_LOW" ReadOnly 0x1020 [16 by 128] = 0x0000_0000,
    "Clock cycles that the real chip would have taken, lower word." { WORD 0 +32 INTEGER "Bits 31..0." }
    report_cycles_high "REPORT_CYCLES_HIGH" ReadOnly 0x1024 [16 by 128] = 0x0000_0000,
    "Clock cycles that the real chip would have taken, upper word." { WORD 0 +32 INTEGER "Bits 63..32." }
    report_omitted "REPORT_OMITTED" ReadOnly 0x1028 [16 by 128] = 0x0000_0000,
    "What the frame did not need and the engine left out; no pixel depends on it." {
        GRADIENT 0 +1 CODE "Gradients."
        ILLUMINATION 1 +1 CODE "Diffuse and specular illumination."
        MODULATION 2 +1 CODE "Gradient magnitude."
        CROP 3 +1 CODE "Cropping."
        CUT 4 +1 CODE "The cut plane."
        CURSOR 5 +1 CODE "The cursor."
        SUBVOLUME 6 +1 CODE "Sub-volume and block range."
        INTERPOLATION_X 8 +1 CODE "Interpolation along permuted x: all weights are zero."
        INTERPOLATION_Y 9 +1 CODE "Interpolation along permuted y: all weights are zero."
        INTERPOLATION_Z 10 +1 CODE "Interpolation along permuted z: all weights are zero."
        SPECULAR 11 +1 CODE "Specular illumination alone."
        PREMULTIPLICATION 12 +1 CODE "Colours times opacity: the lookup table has been multiplied once."
        CLASSIFICATION 13 +1 CODE "Colours of samples that are not the extreme one: looked up once for each ray."
        DECISIONS 14 +1 CODE "Questions after which stage is needed: the pipeline was built for just these stages. \
                              0: the general pipeline, which asks."
        COLORS 15 +1 CODE "Two of three colour channels: colours and highlights are grey."
        EMPTY_BLOCKS 16 +1 CODE "Blocks of samples that are transparent whatever lies between their voxels."
        FINISHED_RAYS 17 +1 CODE "Blocks of samples on rays that can no longer change."
        BEATEN_BLOCKS 18 +1 CODE "Blocks of samples that cannot hold a new extreme value."
        HIDDEN_BLOCKS 19 +1 CODE "Blocks of samples that cropping, cut plane, sub-volume or block range hide."
        TRANSPARENT_BLOCKS 20 +1 CODE "Shading of blocks of samples that turned out transparent."
    }
    report_empty "REPORT_EMPTY" ReadOnly 0x102c [16 by 128] = 0x0000_0000,
    "Samples left out because no value between their block's voxels can be seen or be a new extreme." { COUNT 0 +32 INTEGER "Samples; ends at 2^32-1." }
    report_finished "REPORT_FINISHED" ReadOnly 0x1030 [16 by 128] = 0x0000_0000,
    "Samples left out because no ray of their block can change." { COUNT 0 +32 INTEGER "Samples; ends at 2^32-1." }
    report_checksum "REPORT_CHECKSUM" ReadOnly 0x1034 [16 by 128] = 0x0000_0000,
    "CRC-32 (IEEE) of the rendered rectangle's stored pixels, row by row." { CRC 0 +32 INTEGER "Checksum." }
    report_hidden "REPORT_HIDDEN" ReadOnly 0x1038 [16 by 128] = 0x0000_0000,
    "Samples left out because cropping, cut plane, sub-volume or block range hide their block." {
        COUNT 0 +32 INTEGER "Samples; ends at 2^32-1."
    }
    report_transparent "REPORT_TRANSPARENT" ReadOnly 0x103c [16 by 128] = 0x0000_0000,
    "Samples classified but not shaded: all of their block turned out transparent." {
        COUNT 0 +32 INTEGER "Samples; ends at 2^32-1."
    }
    report_blocks "REPORT_BLOCKS" ReadOnly 0x1040 [16 by 128] = 0x0000_0000,
    "Blocks of samples: up to 32 next to each other along permuted x." {
        COUNT 0 +32 INTEGER "Blocks; ends at 2^32-1."
    }
    report_blocks_left_out "REPORT_BLOCKS_LEFT_OUT" ReadOnly 0x1044 [16 by 128] = 0x0000_0000,
    "Blocks of samples that were left out, for whatever reason." {
        COUNT 0 +32 INTEGER "Blocks; ends at 2^32-1."
    }
    report_rays_finished "REPORT_RAYS_FINISHED" ReadOnly 0x1048 [16 by 128] = 0x0000_0000,
    "Rays that were found unable to change before their end." { COUNT 0 +32 INTEGER "Rays." }
}

/// Bytes of the status block, from offset 0.
pub const STATUS_BLOCK: usize = 0xc0;

/// What `RESET` expects.
pub const RESET_KEY: u32 = 0x5245_5345;

/// Results in `PLANE_STATE` and `TRANSFER_STATE`.
pub mod result {
    /// Nothing has ended yet.
    pub const NONE: u32 = 0;
    /// Done.
    pub const DONE: u32 = 1;
    /// Refused, failed or cancelled.
    pub const FAILED: u32 = 2;
}

/// The register that has a word at byte `offset`, and the word's place in its array.
#[must_use]
pub fn find(offset: u32) -> Option<(&'static Register, u32)> {
    let behind = REGISTERS.partition_point(|register| register.offset <= offset);
    // Arrays of the report block interleave, so the nearest register below is not always the one.
    REGISTERS[..behind].iter().rev().find_map(|register| {
        let distance = offset - register.offset;
        let index = distance / register.stride;
        (distance.is_multiple_of(register.stride) && index < register.count).then_some((register, index))
    })
}

const _: () = assert!(table_select::REGISTER.offset == VIEW_START);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame_registers::{FRAME_END, FRAME_START};
    use crate::pci::MSIX_TABLE_OFFSET;
    use std::collections::HashSet;

    #[test]
    fn words_are_aligned_in_order_and_do_not_overlap() {
        let mut taken = HashSet::new();
        for register in REGISTERS {
            for index in 0..register.count {
                let offset = register.at(index);
                assert_eq!(offset % 4, 0, "{}", register.name);
                assert!(offset < MSIX_TABLE_OFFSET, "{}", register.name);
                assert!(taken.insert(offset), "{} overlaps at {offset:#x}", register.name);
                let (found, place) = find(offset).unwrap();
                assert_eq!((found.offset, place), (register.offset, index));
            }
        }
        assert!(REGISTERS.windows(2).all(|pair| pair[0].offset < pair[1].offset));
    }

    #[test]
    fn names_are_unique_and_fields_fit() {
        let mut names = HashSet::new();
        for register in REGISTERS {
            assert!(names.insert(register.name), "{}", register.name);
            let mut mask = 0;
            for field in register.fields {
                assert!(field.low + field.bits <= 32 && field.bits >= 1, "{}.{}", register.name, field.name);
                assert_eq!(mask & field.mask(), 0, "{}.{} overlaps", register.name, field.name);
                assert!(field.bits <= field.format.bits, "{}.{}", register.name, field.name);
                mask |= field.mask();
            }
            assert_eq!(register.reset & !mask, 0, "{} resets reserved bits", register.name);
        }
    }

    #[test]
    fn start_closes_the_frame_registers() {
        assert_eq!(start::REGISTER.offset, FRAME_END - 4);
        let frame = REGISTERS.iter().filter(|it| (FRAME_START..FRAME_END).contains(&it.offset));
        assert!(frame.clone().all(|register| register.access == Access::WriteOnly));
        let view = frame.filter(|register| register.offset >= VIEW_START).count() as u32;
        assert_eq!(view, (FRAME_END - VIEW_START) / 4, "the view's registers have no gap");
        assert!(view <= 20, "a steady frame costs at most 20 trapped accesses");
    }

    #[test]
    fn unknown_offsets_are_not_found() {
        for offset in [1, 0x18, 0x1100 + 4, 0x11fc, 0x1800, 0xfffc] {
            assert!(find(offset).is_none(), "{offset:#x}");
        }
        assert_eq!(find(0x1034 + 15 * 128).unwrap().1, 15);
    }
}
