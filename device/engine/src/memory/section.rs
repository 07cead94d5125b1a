//! Section memory: what the pipelines carry over from a section to the next one (paper, section 5.4), as
//! [`vg500_regs::section`] lays it out.

use crate::fixed::{GUARDED, VALUE};
use crate::frame::FrameDescription;
use crate::stage::composite::Ray;
use vg500_regs::section::*;
use vg500_regs::table::output;
use vg500_regs::{BlendMode, Fault, FaultCode, Field, SharedView};

/// Greatest interpolated voxel, and greatest interpolated half difference of voxels.
const GREATEST_VOXEL: i32 = ((1 << VALUE.bits) - 1) << GUARDED.fraction;
const GREATEST_DIFFERENCE: i32 = GREATEST_VOXEL / 2;

/// What one beam of a sample slice carries over. A cell is named by its lower voxel along permuted x.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// The last voxel of the beam, interpolated along z.
    pub voxel: i32,
    /// The interpolated [`crate::stage::gradient::voxel_difference`] there.
    pub difference: i32,
    /// The last sample, in the cell before the last voxel.
    pub sample: u16,
    /// The sample before it.
    pub before: u16,
    /// Gradient of `sample` along permuted y and z.
    pub gradient: [i32; 2],
    /// The ray of `before`.
    pub ray: Ray,
}

type Words = [u32; RECORD / 4];

fn put(words: &mut Words, field: Field, value: u32) {
    words[field.register as usize / 4] |= field.put(value);
}

const fn get(words: &Words, field: Field) -> u32 {
    field.get(words[field.register as usize / 4])
}

impl Record {
    /// The record as words. Accumulators saturate; of a colour that only grows, that is no loss.
    #[must_use]
    fn pack(&self, blend: BlendMode) -> Words {
        let mut words = [0; RECORD / 4];
        let most = |field: Field, value: u32| value.min(field.mask() >> field.low);
        put(&mut words, VOXEL_VALUE, self.voxel as u32);
        put(&mut words, DIFFERENCE, self.difference as u32);
        put(&mut words, SAMPLE, self.sample.into());
        put(&mut words, BEFORE, self.before.into());
        put(&mut words, GRADIENT_Y, self.gradient[0] as u32);
        put(&mut words, GRADIENT_Z, self.gradient[1] as u32);
        let [r, g, b] = self.ray.color;
        let channels = [r, g, b, self.ray.alpha];
        for (field, channel) in channel_fields(blend).into_iter().zip(channels) {
            put(&mut words, field, most(field, channel));
        }
        match blend {
            BlendMode::Alpha => {}
            BlendMode::Maximum | BlendMode::Minimum => {
                put(&mut words, EXTREME_VALUE, self.ray.extreme.into());
                put(&mut words, EXTREME_VALID, self.ray.valid.into());
            }
            BlendMode::Sum => put(&mut words, SAMPLES, most(SAMPLES, self.ray.samples)),
        }
        words
    }

    /// The record that words hold. Words that no frame has written give values that the pipeline can bear.
    #[must_use]
    fn unpack(words: &Words, blend: BlendMode) -> Self {
        let word = |field: Field| words[field.register as usize / 4];
        let signed = |field: Field, most: i32| field.get_signed(word(field)).clamp(-most, most);
        let [r, g, b, alpha] = channel_fields(blend).map(|field| get(words, field));
        let mut ray = Ray { color: [r, g, b], alpha, ..Ray::default() };
        match blend {
            BlendMode::Alpha => {}
            BlendMode::Maximum | BlendMode::Minimum => {
                ray.extreme = get(words, EXTREME_VALUE) as u16;
                ray.valid = get(words, EXTREME_VALID) != 0;
            }
            BlendMode::Sum => ray.samples = get(words, SAMPLES),
        }
        Self {
            voxel: signed(VOXEL_VALUE, GREATEST_VOXEL).max(0),
            difference: signed(DIFFERENCE, GREATEST_DIFFERENCE),
            sample: get(words, SAMPLE) as u16,
            before: get(words, BEFORE) as u16,
            gradient: [signed(GRADIENT_Y, 127), signed(GRADIENT_Z, 127)],
            ray,
        }
    }
}

/// The fields of red, green, blue and opacity.
const fn channel_fields(blend: BlendMode) -> [Field; 4] {
    match blend {
        BlendMode::Sum => [SUM_RED, SUM_GREEN, SUM_BLUE, SUM_ALPHA],
        _ => [RED, GREEN, BLUE, ALPHA],
    }
}

/// Section memory as a frame uses it: the records of one sample slice after another.
#[derive(Clone, Copy, Debug)]
pub struct SectionMemory<'a> {
    memory: SharedView<'a>,
    beams: usize,
    blend: BlendMode,
}

impl<'a> SectionMemory<'a> {
    /// The records of a frame of `slices` sample slices; a fault unless the memory holds them.
    pub fn new(frame: &FrameDescription, slices: usize, memory: SharedView<'a>) -> Result<Self, Fault> {
        let beams = frame.permuted_size()[1] as usize;
        if record_offset(slices, 0, beams) > memory.size() {
            return Err(Fault::new(FaultCode::Range, output::SECTIONS));
        }
        Ok(Self { memory, beams, blend: frame.output.blend })
    }

    /// Reads the records of a sample slice, one for each beam.
    pub fn read(&self, slice: usize, records: &mut Vec<Record>) -> Result<(), Fault> {
        let mut bytes = vec![0; self.beams * RECORD];
        self.memory.read(self.first(slice), &mut bytes).map_err(|_| Self::outside())?;
        records.clear();
        records.extend(bytes.chunks_exact(RECORD).map(|bytes| {
            let mut words = [0; RECORD / 4];
            for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
                *word = u32::from_le_bytes(*bytes);
            }
            Record::unpack(&words, self.blend)
        }));
        Ok(())
    }

    /// Writes the records of a sample slice; the words that the blend mode does not use stay as they are.
    pub fn write(&self, slice: usize, records: &[Record]) -> Result<(), Fault> {
        for (beam, record) in records.iter().enumerate() {
            let words = record.pack(self.blend);
            let bytes: Vec<u8> =
                words.iter().take(record_words(self.blend)).flat_map(|word| word.to_le_bytes()).collect();
            let offset = self.first(slice) + beam * RECORD;
            self.memory.write(offset, &bytes).map_err(|_| Self::outside())?;
        }
        Ok(())
    }

    const fn first(&self, slice: usize) -> usize {
        record_offset(slice, 0, self.beams)
    }

    const fn outside() -> Fault {
        Fault::new(FaultCode::Range, output::SECTIONS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn record() -> impl Strategy<Value = Record> {
        let gradient = [-127..=127i32, -127..=127];
        let values = (0..=GREATEST_VOXEL, -GREATEST_DIFFERENCE..=GREATEST_DIFFERENCE, gradient);
        let samples = [0..=4095u16, 0..=4095];
        let sums = [0..1u32 << 28, 0..1 << 28, 0..1 << 28, 0..1 << 28];
        (values, samples, sums, 0..=4095u16, any::<bool>(), 0..=32768u32).prop_map(
            |((voxel, difference, gradient), [sample, before], sums, extreme, valid, samples)| {
                let [r, g, b, alpha] = sums;
                let ray = Ray { color: [r, g, b], alpha, extreme, valid, samples };
                Record { voxel, difference, sample, before, gradient, ray }
            },
        )
    }

    /// What a blend mode keeps of a ray.
    fn kept(record: Record, blend: BlendMode) -> Record {
        let ray = record.ray;
        let twelve = |channel: u32| channel.min(4095);
        let blended = Ray { color: ray.color.map(twelve), alpha: twelve(ray.alpha), ..Ray::default() };
        let ray = match blend {
            BlendMode::Alpha => blended,
            BlendMode::Maximum | BlendMode::Minimum => {
                Ray { extreme: ray.extreme, valid: ray.valid, ..blended }
            }
            BlendMode::Sum => Ray { extreme: 0, valid: false, ..ray },
        };
        Record { ray, ..record }
    }

    const MODES: [BlendMode; 4] = [BlendMode::Alpha, BlendMode::Maximum, BlendMode::Minimum, BlendMode::Sum];

    proptest! {
        #[test]
        fn records_come_back(record in record()) {
            for blend in MODES {
                prop_assert_eq!(Record::unpack(&record.pack(blend), blend), kept(record, blend));
            }
        }

        #[test]
        fn any_words_are_values_that_the_pipeline_can_bear(words: Words) {
            for blend in MODES {
                let record = Record::unpack(&words, blend);
                prop_assert!((0..=GREATEST_VOXEL).contains(&record.voxel));
                prop_assert!(record.difference.abs() <= GREATEST_DIFFERENCE);
                prop_assert!(record.gradient.iter().all(|component| component.abs() <= 127));
                prop_assert!(record.sample <= 4095 && record.before <= 4095);
                prop_assert_eq!(Record::unpack(&record.pack(blend), blend), record);
            }
        }
    }
}
